"""The guard: a process of its own that ends the flight's process when its control loop falls silent.

MAVSDK repeats the last setpoint from a thread of its own, so that an autopilot never learns of a hung program: it flies
on to the last setpoint for ever. When the flight's process is gone, so is the stream, and the autopilot's own failsafe
acts (PX4: COM_OBL_RC_ACT, after COM_OF_LOSS_T). Ending it is final on purpose: a program that was stuck or stopped must
not come back and send where the vehicle was seconds ago.

Runs by itself as `python guard_process.py PID LIMIT_S`, with the beats on its standard input; it imports next to
nothing, so that it starts at once, and nothing of ours can hang it. mission.guard is the other end.
"""

import os
import select
import signal
import sys

ARM, BEAT, STAND_DOWN = b"a", b".", b"s"
"""What the flight says: watch from now on; alive; watch no more."""

READY = b"r"
"""What the guard says once it can act."""

_SLICES = 8
_STALLED = (
    "\nlineflight: the control loop was silent for {limit_s:g} s. Its process was ended, so that the autopilot's own "
    "failsafe takes over; nothing sends setpoints any more. When the vehicle is safe: lineflight resume --explain\n"
)


def watch(pid: int, limit_s: float) -> None:
    """Read beats from standard input until it ends; kill `pid` when none came for `limit_s` [s].

    The silence is counted in slices in which this process itself was awake: a computer that was asleep as a whole, this
    process included, has not been silent.
    """
    # By its file descriptor: a number could belong to somebody else by the time it is needed.
    flight = os.pidfd_open(pid)
    os.write(sys.stdout.fileno(), READY)
    is_armed = False
    n_silent = 0
    while True:
        readable, _, _ = select.select([0], [], [], limit_s / _SLICES)
        if not readable:
            n_silent += 1
            if is_armed and n_silent >= _SLICES:
                signal.pidfd_send_signal(flight, signal.SIGKILL)
                sys.stderr.write(_STALLED.format(limit_s=limit_s))
                return
            continue
        said = os.read(0, 4096)
        if not said:  # the flight has ended by itself
            return
        n_silent = 0
        last = max(said.rfind(ARM), said.rfind(STAND_DOWN))
        if last >= 0:
            is_armed = said[last : last + 1] == ARM


if __name__ == "__main__":
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # these are for the flight, which needs its guard until it has ended
    watch(int(sys.argv[1]), float(sys.argv[2]))
