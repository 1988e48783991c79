"""`lineflight world`: what it lists, shows and writes, and what it answers to bad input."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from mission.simulated.world_commands import app
from sitl.world.file import load_world, shipped_worlds

MAP = {
    "type": "FeatureCollection",
    "features": [
        {
            "type": "Feature",
            "properties": {"power": "minor_line", "voltage": "13200"},
            "geometry": {"type": "LineString", "coordinates": [[-73.9, 4.9], [-73.8995, 4.9], [-73.899, 4.9]]},
        }
    ],
}


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments], env={"COLUMNS": "120"})


def assert_refused(ran: Result, *words: str) -> None:
    assert ran.exit_code == 2
    assert ran.stderr.count("\n") == 1
    assert ran.stderr.endswith(".\n")
    for word in words:
        assert word in ran.stderr


def test_list_names_every_world_with_a_sentence() -> None:
    ran = run("list")
    assert ran.exit_code == 0
    lines = ran.stdout.splitlines()
    assert [line.split()[0] for line in lines] == shipped_worlds()
    assert all(len(line.split()) > 4 for line in lines)
    assert sum("(the default)" in line for line in lines) == 1


@pytest.mark.parametrize("name", shipped_worlds())
def test_show_says_what_is_in_a_world(name: str) -> None:
    ran = run("show", name)
    assert ran.exit_code == 0
    assert name in ran.stdout
    assert "over ground" in ran.stdout
    assert "light noon" in ran.stdout


def test_show_tells_heights_spans_and_sags() -> None:
    shown = run("show", "high_voltage").stdout
    for words in ("5 lattice towers, 29 m", " 6 ", "260-290 m", "flat terrain", "1 river"):
        assert words in shown
    shown = run("show", "crossing").stdout
    assert "low voltage" in shown
    assert "55 m" in shown
    assert "terrain hills" in run("show", "hills").stdout
    assert "buildings" in run("show", "village").stdout


def test_import_writes_a_world_that_can_be_shown(tmp_path: Path) -> None:
    source, out = tmp_path / "valley.geojson", tmp_path / "valley.yaml"
    source.write_text(json.dumps(MAP), encoding="utf-8")
    ran = run("import", source, "--out", out)
    assert ran.exit_code == 0, ran.stderr
    assert "1 line on 3 supports" in ran.stdout
    assert len(load_world(str(out)).supports) == 3
    assert run("show", out).exit_code == 0
    assert run("import", source, "--out", out, "--start-support", "2").exit_code == 0


def test_bad_input_ends_in_one_sentence(tmp_path: Path) -> None:
    source = tmp_path / "valley.geojson"
    source.write_text(json.dumps(MAP), encoding="utf-8")
    assert_refused(run("show", "atlantis"), "atlantis", "medium_voltage")
    assert_refused(run("import", tmp_path / "none.json"), "none.json")
    ran = run("import", source, "--start-support", "3", "--out", tmp_path / "w.yaml")
    assert_refused(ran, "--start-support", "from 1 to 2")
    assert_refused(run("import", source, "--out", tmp_path / "w.txt"), "ends in .yaml")
    assert_refused(run("import", source, "--out", tmp_path / "no" / "w.yaml"), "cannot be written")
    broken = tmp_path / "broken.yaml"
    broken.write_text("version: 2\n", encoding="utf-8")
    assert_refused(run("show", broken), "broken.yaml", "origin")
