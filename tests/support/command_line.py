"""Running the command line as a person would."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
TIMEOUT_S = 400.0


@dataclass(frozen=True)
class Ran:
    """What a command printed, and how it ended."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """The last line of the output as JSON."""
        return json.loads(self.out.splitlines()[-1])


def lineflight(*arguments: str | Path) -> Ran:
    """Run `lineflight ARGUMENTS` to its end."""
    done = subprocess.run(_command(arguments), cwd=ROOT, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    return Ran(done.returncode, done.stdout, done.stderr)


def lineflight_stopped(*arguments: str | Path, at: str, with_signal: int = signal.SIGINT) -> Ran:
    """Run `lineflight ARGUMENTS`, and signal its whole group, as a terminal does, once stderr has a line with `at`."""
    process = subprocess.Popen(
        _command(arguments), cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stderr is not None
    heard = []
    for line in process.stderr:
        heard.append(line)
        if at in line:
            os.killpg(process.pid, with_signal)
            break
    out, err = process.communicate(timeout=TIMEOUT_S)
    return Ran(process.returncode, out, "".join(heard) + err)


def _command(arguments: Sequence[str | Path]) -> list[str]:
    return [sys.executable, "-m", "mission.cli", *map(str, arguments)]
