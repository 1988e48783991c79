"""Whole flights as a person starts them: real MAVSDK over UDP, the rendered world, vision in the loop."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from drivers.camera.calibration_file import write_calibration
from drivers.camera.camera import Intrinsics
from mission.log.reader import read_flight
from mission.simulated.simulation import free_udp_port
from tests.replay.own_estimates import distance_m, replay_own_estimates
from tests.support.careless import check_contact_in_log, write_careless_mission
from tests.support.command_line import ROOT, lineflight, lineflight_stopped
from tests.support.short_mission import short_mission

pytestmark = pytest.mark.real_time

FOLLOW_LINE = ROOT / "missions" / "follow_line.yaml"
ALL_TASKS = ROOT / "tests" / "data" / "all_tasks.yaml"


def test_dry_run_follows_the_line_and_comes_home(tmp_path: Path) -> None:
    ran = lineflight("dry-run", FOLLOW_LINE, "--speed", "2", "--wind", "2", "--log", tmp_path, "--json")
    assert ran.code == 0, ran.err
    assert "Traceback" not in ran.err
    report = ran.json
    assert report["mission"] == "follow_line"
    assert report["result"] == "completed"
    assert [task["task"] for task in report["tasks"]] == [
        "takeoff", "ascend", "move_until", "align", "follow_lines", "rotate", "follow_lines", "rotate", "move_forward",
        "descend", "land",
    ]  # fmt: skip
    assert {task["result"] for task in report["tasks"]} == {"completed"}
    assert len(report["legs"]) == 2
    for leg in report["legs"]:
        assert leg["task"] == "follow_lines"
        assert leg["n_points"] > 100
        assert leg["avg_error_m"] < 0.25
        assert leg["avg_error_m"] < leg["p95_error_m"] < 1.0
    assert report["lateral"]["mean_m"] < 0.5
    assert report["yaw_error"]["median_deg"] < 3.0
    assert report["landing"]["distance_m"] < 1.5
    assert report["landing"]["is_disarmed"] is True
    assert report["setpoints"]["rate_hz"] == pytest.approx(20.0, rel=0.1)
    assert report["vision"]["estimates"] > 100
    assert report["events"] == []
    assert report["preflight"]["n_checks"] >= 18
    assert report["preflight"]["warnings"] == report["preflight"]["failures"] == []
    assert Path(report["picture"]).stat().st_size > 100_000
    assert Path(report["page"]).stat().st_size > 5_000_000

    ticks = replay_own_estimates(read_flight(Path(report["log"])))
    assert len(ticks) > 1000
    assert max(map(distance_m, ticks)) < 0.001  # whatever was late in flight: each tick sees what it saw

    inspected = lineflight("inspect", report["log"], "--json")
    assert inspected.code == 0
    assert {key: report[key] for key in inspected.json} == inspected.json
    shown = lineflight("inspect", report["log"])
    assert "follow_line" in shown.out
    assert "completed" in shown.out


def test_ctrl_c_while_following_leaves_the_vehicle_landed_and_a_readable_log(tmp_path: Path) -> None:
    ran = lineflight_stopped("dry-run", ALL_TASKS, "--speed", "3", "--log", tmp_path, "--json", at="6/10 follow_lines")
    assert ran.code == 130, ran.err
    assert "Traceback" not in ran.err
    assert ran.json["result"] == "interrupted"
    assert ran.json["landing"]["is_disarmed"] is True
    assert [event["name"] for event in ran.json["events"]] == ["interrupted"]
    assert lineflight("inspect", ran.json["log"], "--json").json["result"] == "interrupted"


def test_run_flies_the_simulated_vehicle_of_another_process_and_sigterm_lands_it(tmp_path: Path) -> None:
    port = free_udp_port()
    command = [sys.executable, "-m", "mission.cli", "sitl", "--port", str(port)]
    vehicle = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True)
    try:
        ran = lineflight_stopped(
            "run", ALL_TASKS, "--connection", f"udpin://127.0.0.1:{port}", "--camera", "sim:",
            "--log", tmp_path, "--json", at="2/10 ascend", with_signal=signal.SIGTERM,
        )  # fmt: skip
    finally:
        os.kill(vehicle.pid, signal.SIGINT)
        _, words = vehicle.communicate(timeout=30)
    assert ran.code == 130, ran.err
    assert ran.json["result"] == "interrupted"
    assert ran.json["landing"]["is_disarmed"] is True
    assert ran.json["lateral"] is None
    assert vehicle.returncode == 0, words
    assert "Traceback" not in words


def test_run_without_a_vehicle_is_not_ready(tmp_path: Path) -> None:
    connection = f"udpin://127.0.0.1:{free_udp_port()}"
    ran = lineflight("run", ALL_TASKS, "--connection", connection, "--camera", "sim:", "--log", tmp_path, "--json")
    assert ran.code == 3, ran.err
    assert "no autopilot was heard" in ran.json["reason"]
    assert "Traceback" not in ran.err


def test_a_lens_that_bends_the_line_is_corrected_in_flight(tmp_path: Path) -> None:
    """The simulated camera has the calibrated lens; without the correction it would lose the line (docs/decisions)."""
    lens = Intrinsics(640, 480, 381.4, 381.4, 319.5, 239.5, (-0.24, 0.05, 0.0, 0.0, 0.0))
    write_calibration(tmp_path / "lens.yaml", lens, 0.2, "a test")
    (tmp_path / "mission.yaml").write_text(short_mission("camera: {calibration: lens.yaml}"))
    ran = lineflight("dry-run", tmp_path / "mission.yaml", "--speed", "2", "--log", tmp_path, "--json")
    assert ran.code == 0, ran.err
    assert ran.json["result"] == "completed"
    assert ran.json["lateral"]["mean_m"] < 0.5
    assert ran.json["yaw_error"]["median_deg"] < 3.0
    assert ran.json["events"] == []


def test_what_the_vehicle_of_the_other_process_touches_is_in_the_log(tmp_path: Path) -> None:
    mission = write_careless_mission(tmp_path)
    ran = lineflight("dry-run", mission, "--speed", "2", "--seed", "1", "--log", tmp_path, "--json")
    assert ran.code == 4, ran.err
    assert "Traceback" not in ran.err
    check_contact_in_log(Path(ran.json["log"]), ran.json["contact"])
