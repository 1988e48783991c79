"""A program that flies a mission over real MAVLink, and whose control loop stops in the middle of a task.

python -m tests.over_mavlink.program PORT SPEED EPOCH_NS FOLDER TASK HOW

Everything is as in a flight but for the eyes, which see the line by geometry from the telemetry. It says on standard
output when it stops: `stopped MONOTONIC_NS`. HOW is one of STOPS, or `wait`: then it only says so, and goes on; or
`resume`: then it takes up what the journal in FOLDER has left. TASK may be a mission file, which is flown to its end.
"""

import asyncio
import ctypes
import sys
import time
from pathlib import Path

from drivers.clock import ScaledClock
from mission.autopilot_mavsdk import MavsdkAutopilot
from mission.camera_plan import pinhole_intrinsics
from mission.executive import Crew, Executive
from mission.guard import Guard
from mission.hazards import ComputerView
from mission.journal import DiskJournal, read_journal
from mission.logbook import Logbook
from mission.plan import MissionPlan
from mission.plan_file import read_mission
from mission.records import TaskStarted
from mission.resumption import find_resumption
from sitl.control import quaternion_of
from tests.faults.flight import TASK_PLANS
from tests.support.flights import LINE_HEADING_RAD, LINE_POINT_NED_M, PAPERS, KeptLog
from tests.support.geometric_eyes import GeometricEyes, Pose


def say(words: str) -> None:
    """Tell who looks on."""
    sys.stdout.write(words + "\n")
    sys.stdout.flush()


def spin() -> None:
    """A loop that never ends."""
    while True:
        pass


def sleep() -> None:
    """A call that blocks for ever."""
    time.sleep(1e6)


def keep_the_lock() -> None:
    """A C function that blocks for ever and holds the interpreter's lock: no other thread of Python's runs."""
    ctypes.PyDLL(None).sleep(1_000_000)


JOURNAL = "flight.journal"
STOPS = {"spin": spin, "sleep": sleep, "lock": keep_the_lock}
AFTER_S = {"takeoff": 4.0, "return": 3.0, "land": 3.0}
"""Into a task; the others are stopped after a second, when the heartbeat has told of offboard."""


async def fly(port: int, clock: ScaledClock, folder: Path, task: str, how: str) -> None:
    """Fly the mission for `task`, and stop in it."""
    if task.endswith(".yaml"):
        plan = read_mission(Path(task)).plan
    else:
        plan = MissionPlan.model_validate({"version": 1, "name": "stops", "tasks": TASK_PLANS[task]})
    camera = pinhole_intrinsics(plan.camera)
    autopilot = MavsdkAutopilot(f"udpin://127.0.0.1:{port}", clock, lambda text: None)
    loop = asyncio.get_running_loop()

    def pose() -> Pose | None:
        state = autopilot.state
        if state is None:
            return None
        place = (state.north_m, state.east_m, state.down_m)
        return place, quaternion_of(state.roll_rad, state.pitch_rad, state.yaw_rad)

    def stop() -> None:
        say(f"stopped {time.monotonic_ns()}")
        if how in STOPS:
            STOPS[how]()

    def on_record(item: object) -> None:
        if isinstance(item, TaskStarted) and item.task == task:
            loop.call_later(clock.wall_s(AFTER_S.get(task, 1.2)), stop)

    resumption = None
    if how == "resume":
        plan, resumption = find_resumption(*read_journal(folder / JOURNAL), plan, PAPERS.mission_sha256)
    journal = DiskJournal(folder / (JOURNAL if resumption is None else "resumed.journal"))
    with Guard() as guard:
        eyes = GeometricEyes(pose, clock, camera, LINE_POINT_NED_M, LINE_HEADING_RAD)
        crew = Crew(autopilot, eyes, camera, KeptLog(on_record), Logbook(journal, PAPERS), ComputerView)
        executive = Executive(plan, crew, clock, resumption)
        beating = asyncio.create_task(guard.beat(lambda: executive.tick_s))
        ended = await executive.run()
        beating.cancel()
        await asyncio.gather(beating, return_exceptions=True)
        await autopilot.close()
    await journal.close()
    say(f"ended {ended.result} {ended.reason}")


if __name__ == "__main__":
    asyncio.run(
        fly(
            int(sys.argv[1]),
            ScaledClock(float(sys.argv[2]), int(sys.argv[3])),
            Path(sys.argv[4]),
            sys.argv[5],
            sys.argv[6],
        )
    )
