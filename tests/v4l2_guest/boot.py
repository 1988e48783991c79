"""Run the device tests on a real V4L2 driver: boot Debian's kernel in QEMU, with `vivid` and the host's files.

    python -m tests.v4l2_guest.boot [PYTEST'S ARGUMENTS]

Nothing is installed in the guest: it sees the host's root read-only and runs this very interpreter.
"""

import os
import re
import shlex
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path

from tests.v4l2_guest.debian import Parts, find_parts
from tests.v4l2_guest.errors import GuestError
from tests.v4l2_guest.initramfs import write_initramfs

CHECKOUT = Path(__file__).parents[2]
CACHE = CHECKOUT / ".v4l2-guest"
LOG = CACHE / "console.log"
TESTS = "tests/v4l2_guest/device_tests.py"

TIME_LIMIT_S = 600.0
KVM_START_LIMIT_S = 15.0


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a guest ended. `exit_code` is the command's own; None when the guest did not live to tell."""

    is_up: bool
    exit_code: int | None


def guest_command(arguments: list[str]) -> str:
    """The line of shell that the guest runs."""
    # Hypothesis would want to write into the checkout.
    plugins = ["-p", "no:cacheprovider", "-p", "no:hypothesispytest"]
    pytest = [sys.executable, "-m", "pytest", "-v", *plugins, TESTS, *arguments]
    return f"cd {shlex.quote(str(CHECKOUT))} && exec {shlex.join(pytest)}"


def run_guest(parts: Parts, initramfs: Path, accelerator: str, start_limit_s: float) -> Outcome:
    """Boot the guest, show and log its console, and wait for its end.

    It is stopped when its `init` has not begun after `start_limit_s` [s, wall], and after TIME_LIMIT_S in any case.
    """
    guest = subprocess.Popen(
        [
            "qemu-system-x86_64",
            *("-accel", accelerator, "-cpu", "max", "-smp", "2", "-m", "2048", "-no-reboot"),
            *("-display", "none", "-serial", "stdio", "-monitor", "none", "-nic", "none"),
            *("-kernel", str(parts.kernel), "-initrd", str(initramfs), "-append", "console=ttyS0 quiet panic=-1"),
            *("-virtfs", "local,path=/,mount_tag=host,security_model=none,readonly=on,multidevs=remap"),
        ],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    assert guest.stdout is not None
    limits = [threading.Timer(limit_s, guest.kill) for limit_s in (start_limit_s, TIME_LIMIT_S)]
    for limit in limits:
        limit.start()
    is_up, exit_code = False, None
    try:
        with LOG.open("wb") as log:
            for line in guest.stdout:
                log.write(line)
                sys.stdout.write(line.decode(errors="replace"))
                sys.stdout.flush()
                if line.startswith(b"guest: up"):
                    is_up = True
                    limits[0].cancel()
                elif ended := re.match(rb"guest: ended with (\d+)", line):
                    exit_code = int(ended[1])
    finally:
        for limit in limits:
            limit.cancel()
        guest.kill()
        guest.wait()
    return Outcome(is_up, exit_code)


def main(arguments: list[str]) -> int:
    """Run the device tests in a guest; `arguments` are pytest's. Returns pytest's exit code."""
    parts = find_parts(CACHE / "debian")
    initramfs = CACHE / "initramfs"
    write_initramfs(parts, guest_command(arguments), initramfs)
    outcome = Outcome(is_up=False, exit_code=None)
    # Inside some virtual machines KVM opens but never runs a guest: only a sign of life tells.
    if os.access("/dev/kvm", os.R_OK | os.W_OK):
        outcome = run_guest(parts, initramfs, "kvm", KVM_START_LIMIT_S)
    if not outcome.is_up:
        sys.stdout.write("Booting the guest without KVM; its first words take half a minute.\n")
        outcome = run_guest(parts, initramfs, "tcg,thread=multi", TIME_LIMIT_S)
    if outcome.exit_code is None:
        raise GuestError(f"The guest died, or took longer than {TIME_LIMIT_S:g} s; read its console log, {LOG}.")
    return outcome.exit_code


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except GuestError as error:
        sys.exit(str(error))
