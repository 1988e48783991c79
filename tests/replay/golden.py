"""Make the golden flight: `python -m tests.replay.golden`, after a change of vision or guidance that is meant.

It is flown in virtual time, made small by keeping only the frames that somebody steers by, and replayed once: what that
gives is the reference which later replays are held against.
"""

import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path

from drivers.mcap_stream import IMAGE_TOPIC
from mission.log import channels
from mission.log.copying import write_copy
from mission.log.reader import Flight, read_flight
from mission.log.records import VisionEntry
from mission.plan_file import read_mission
from mission.replay.replay import replay, write_reference
from mission.simulated.scenario import Scenario
from mission.simulated.virtual_flight import fly_virtually

GOLDEN = Path(__file__).parents[1] / "data" / "golden_flight.mcap"
MISSION = """\
version: 1
name: golden
tasks:
  - {task: takeoff, altitude_m: 5}
  - {task: ascend, altitude_m: 16}
  - {task: move_until}
  - {task: align, turn: right}
  - {task: follow_lines, distance_m: 20}
  - {task: return}
camera: {rate_hz: 15, width_px: 480, height_px: 360}
vision: {log_rate_hz: 3}
safety: {line_height_m: 10.3}
"""
SCENARIO = Scenario(seed=5, wind_m_s=4.0)
_STEERED_BY = ("move_until", "align", "follow_lines")
_NEEDED = (channels.IMAGE, channels.CALIBRATION, channels.LOG)
_NOT_NEEDED = {channel.topic for channel in channels.FOXGLOVE_CHANNELS if channel not in _NEEDED}


def make(out: Path) -> None:
    """Fly, thin, replay and write."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        mission = folder / "golden.yaml"
        mission.write_text(MISSION)
        outcome, _ = fly_virtually(read_mission(mission), SCENARIO, folder, lambda _: None, lambda _: None)
        thin = folder / "thin.mcap"
        flown = read_flight(outcome.log)
        write_copy(outcome.log, thin, [], lambda _: None, partial(_kept, flown))
        flight = read_flight(thin)
        out.unlink(missing_ok=True)
        write_reference(flight, replay(flight), out, lambda _: None)


def _kept(flight: Flight, topic: str, log_time_ns: int, data: bytes) -> bytes | None:
    """What stays of a message; None: nothing."""
    if topic in _NOT_NEEDED:
        return None
    is_steered_by = _is_steered_by(flight, log_time_ns - flight.mission.unix_minus_flight_ns)
    if topic == IMAGE_TOPIC:
        return data if is_steered_by else None
    if topic == channels.CHANNEL_OF[VisionEntry].topic and not is_steered_by:
        return channels.encode(replace(channels.decode(topic, data), has_image=False))
    return data


def _is_steered_by(flight: Flight, t_ns: int) -> bool:
    running = None
    for started in flight.tasks_started:
        if started.t_ns <= t_ns:
            running = started.task
    return running in _STEERED_BY


if __name__ == "__main__":
    make(GOLDEN)
