"""Output that cannot be written: a sentence and exit code 1; a reader that has gone: nothing."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.log.synthetic_flight import fly, write_log
from tests.support.command_line import ROOT

FULL = Path("/dev/full")
SHORT_MISSION = "version: 1\nname: hop\ntasks:\n  - {task: takeoff, altitude_m: 3}\n  - {task: land}\n"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("logs") / "flight.mcap"
    assert write_log(path, list(fly())[:2000]).failure is None
    return path


def run(arguments: list[str], out: int, err: int) -> tuple[int, str]:
    command = [sys.executable, "-m", "mission.cli", *arguments]
    done = subprocess.run(command, cwd=ROOT, stdout=out, stderr=err, text=True, timeout=300, check=False)
    return done.returncode, done.stderr or ""


@pytest.mark.parametrize("options", [[], ["--json"]])
def test_a_full_disk_behind_the_output_is_a_sentence(log: Path, options: list[str]) -> None:
    with FULL.open("wb") as full:
        code, err = run(["inspect", str(log), *options], full.fileno(), subprocess.PIPE)
        assert code == 1
        assert err == "The output could not be written (No space left on device); send it to where there is room.\n"
        assert run(["--help"], full.fileno(), subprocess.PIPE) == (1, err)
        assert run(["inspect", str(log), *options], full.fileno(), full.fileno())[0] == 1


def test_a_terminal_that_takes_nothing_ends_no_flight(tmp_path: Path) -> None:
    (tmp_path / "hop.yaml").write_text(SHORT_MISSION)
    arguments = ["dry-run", str(tmp_path / "hop.yaml"), "--virtual-time", "--log", str(tmp_path), "--json"]
    with FULL.open("wb") as full:
        assert run(arguments, full.fileno(), full.fileno())[0] == 1
        (flown,) = tmp_path.glob("*.mcap")
        assert run(["inspect", str(flown)], subprocess.DEVNULL, full.fileno())[0] == 0


def test_what_is_said_beside_the_output_changes_no_exit_code(tmp_path: Path) -> None:
    with FULL.open("wb") as full:
        assert run(["inspect", str(tmp_path / "none.mcap")], subprocess.DEVNULL, full.fileno())[0] == 2


@pytest.mark.parametrize("options", [[], ["--json"]])
def test_a_reader_that_has_gone_is_nothing_to_speak_of(log: Path, options: list[str]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    try:
        assert run(["inspect", str(log), *options], writer, subprocess.PIPE) == (1, "")
    finally:
        os.close(writer)


@pytest.mark.parametrize("command", [["export", "csv"], ["export", "kml"], ["inspect", "--html"]])
def test_a_full_disk_behind_a_file_is_a_sentence(log: Path, tmp_path: Path, command: list[str]) -> None:
    target = tmp_path / {"csv": "tables", "kml": "a.kml", "--html": "a.html"}[command[-1]]
    arguments = (
        [*command, str(log), str(target)] if command[0] == "export" else ["inspect", str(log), "--html", str(target)]
    )
    limited = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096));"
        "from mission.cli import main; sys.argv = ['lineflight', *sys.argv[1:]]; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", limited, *arguments], cwd=ROOT, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 1, done.stderr
    assert f"{target}" in done.stderr
    assert "cannot be written (File too large)" in done.stderr
    assert "Traceback" not in done.stderr
    assert not target.exists()


def test_a_reader_of_errors_that_has_gone_changes_no_exit_code(tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    try:
        assert run(["inspect", str(tmp_path / "none.mcap")], subprocess.DEVNULL, writer)[0] == 2
    finally:
        os.close(writer)
