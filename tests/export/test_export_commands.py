"""`lineflight export` as a person calls it."""

import json
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from mission.log import channels
from mission.log.reader import Flight
from mission.records import Origin
from tests.support.command_line import ROOT, TIMEOUT_S, Ran, lineflight
from tests.support.damaged_log import damage_chunks, write_in_chunks


def assert_plain(ran: Ran, code: int) -> None:
    assert ran.code == code, ran.err
    assert "Traceback" not in ran.err + ran.out


def without_module(name: str, *arguments: str | Path) -> Ran:
    """Run the command line where a module cannot be imported."""
    program = f"import sys; sys.modules[{name!r}] = None; from mission.cli import main; main()"
    command = [sys.executable, "-c", program, *map(str, arguments)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    return Ran(done.returncode, done.stdout, done.stderr)


@pytest.mark.parametrize(("command", "out"), [("csv", "a"), ("parquet", "b")])
def test_tables(flight: Flight, tmp_path: Path, command: str, out: str) -> None:
    folder = tmp_path / out
    ran = lineflight("export", command, flight.path, folder)
    assert_plain(ran, 0)
    names = [file.name for file in folder.iterdir()]
    assert f"vehicle_state.{command}" in names
    assert ran.out.startswith(f"{folder}: {len(names)} tables with ")
    assert len(ran.out.splitlines()) == 1


def test_maps(flight: Flight, tmp_path: Path) -> None:
    for file in (tmp_path / "a.kml", tmp_path / "a.geojson"):
        ran = lineflight("export", file.suffix[1:], flight.path, file)
        assert_plain(ran, 0)
        assert "11 pieces of track, " in ran.out
        assert "1 event, 2 pieces of the line as known, 3 true conductors" in ran.out
    ET.parse(tmp_path / "a.kml")  # noqa: S314
    assert json.loads((tmp_path / "a.geojson").read_text())["type"] == "FeatureCollection"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.geojson", "a.kml"]


def test_images(flight: Flight, flight_without_origin: Flight, tmp_path: Path) -> None:
    ran = lineflight("export", "images", flight.path, tmp_path / "a", "--task", "follow_lines")
    assert_plain(ran, 0)
    n_images = len(list((tmp_path / "a" / "images").iterdir()))
    assert ran.out.startswith(f"{tmp_path / 'a'}: {n_images} images")
    assert len(ran.out.splitlines()) == 1
    assert sorted(file.name for file in (tmp_path / "a" / "sparse" / "0").iterdir()) == [
        "cameras.txt", "images.txt", "points3D.txt",
    ]  # fmt: skip
    ran = lineflight("export", "images", flight_without_origin.path, tmp_path / "b", "--every", "4")
    assert_plain(ran, 0)
    assert "no GPS position" in ran.out


@pytest.mark.parametrize("command", ["kml", "geojson"])
def test_a_log_without_origin_is_no_map(flight_without_origin: Flight, tmp_path: Path, command: str) -> None:
    file = tmp_path / f"map.{command}"
    ran = lineflight("export", command, flight_without_origin.path, file)
    assert_plain(ran, 2)
    assert "where on Earth the local frame lies" in ran.err
    assert not file.exists()


@pytest.mark.parametrize(
    ("module", "command", "extra"), [("pyarrow", "parquet", "parquet"), ("PIL", "images", "export")]
)
def test_what_is_not_installed_is_told(flight: Flight, folder: Path, module: str, command: str, extra: str) -> None:
    ran = without_module(module, "export", command, flight.path, folder)
    assert_plain(ran, 2)
    assert f"pip install 'lineflight[{extra}]'" in ran.err
    assert not folder.exists()


@pytest.mark.parametrize("module", ["pyarrow", "PIL"])
def test_the_other_exports_need_no_extra(flight: Flight, folder: Path, module: str) -> None:
    assert_plain(without_module(module, "export", "csv", flight.path, folder), 0)
    assert_plain(without_module(module, "export", "kml", flight.path, folder / "a.kml"), 0)


@pytest.mark.parametrize(("command", "out"), [("csv", "out"), ("parquet", "out"), ("images", "out"), ("kml", "a.kml"),
                                              ("geojson", "a.json")])  # fmt: skip
def test_bad_input_is_one_sentence(flight: Flight, tmp_path: Path, command: str, out: str) -> None:
    ran = lineflight("export", command, "none.mcap", tmp_path / out)
    assert_plain(ran, 2)
    assert "none.mcap" in ran.err
    assert len(ran.err.splitlines()) == 1
    assert not (tmp_path / out).exists()
    (tmp_path / "file").write_text("in the way")
    ran = lineflight("export", command, flight.path, tmp_path / "file" / out)
    assert_plain(ran, 1)
    assert len(ran.err.splitlines()) == 1


def test_files_are_never_overwritten(flight: Flight, tmp_path: Path) -> None:
    file = tmp_path / "a.kml"
    file.write_text("mine")
    ran = lineflight("export", "kml", flight.path, file)
    assert_plain(ran, 2)
    assert "exists already" in ran.err
    assert file.read_text() == "mine"


@pytest.mark.parametrize("log", [ROOT / "missions" / "follow_line.yaml", ROOT / "missions"])
def test_what_is_no_log_is_refused(tmp_path: Path, log: Path) -> None:
    ran = lineflight("export", "csv", log, tmp_path / "out")
    assert_plain(ran, 2)
    assert str(log) in ran.err
    assert not (tmp_path / "out").exists()


def test_a_file_of_another_kind_is_refused(flight: Flight, tmp_path: Path) -> None:
    ran = lineflight("export", "kml", flight.path, tmp_path / "a.kmz")
    assert_plain(ran, 2)
    assert ".kml" in ran.err


def test_what_a_damaged_log_lacks_is_told_before_it_is_refused(flight: Flight, tmp_path: Path) -> None:
    """The autopilot did tell where the flight was: the log has lost it since."""
    small, log = tmp_path / "small.mcap", tmp_path / "damaged.mcap"
    write_in_chunks(flight.path, small, 20_000)
    assert damage_chunks(small, log, lambda _, topics: channels.CHANNEL_OF[Origin].topic in topics)
    ran = lineflight("export", "kml", log, tmp_path / "a.kml")
    assert_plain(ran, 2)
    damage, refusal = ran.err.splitlines()
    assert damage.startswith(f"{log}: ")
    assert "damaged" in damage
    assert "this log does not tell it" in refusal


def test_a_log_that_was_cut_off_is_exported_and_the_cut_told(flight: Flight, tmp_path: Path) -> None:
    log = tmp_path / "cut.mcap"
    log.write_bytes(flight.path.read_bytes()[: flight.path.stat().st_size // 2])
    ran = lineflight("export", "csv", log, tmp_path / "out")
    assert_plain(ran, 0)
    assert ran.err == f"{log}: The log was cut off; this is what it still holds.\n"


def test_one_image_is_one_image(flight: Flight, tmp_path: Path) -> None:
    ran = lineflight("export", "images", flight.path, tmp_path / "a", "--every", "1000000")
    assert_plain(ran, 0)
    assert ran.out.startswith(f"{tmp_path / 'a'}: 1 image, and its pose")
