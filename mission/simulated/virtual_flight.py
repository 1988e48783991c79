"""A dry-run in virtual time: simulated vehicle, camera, vision and executive in one process, without MAVLink.

It goes as fast as the machine can, and the same scenario gives the same flight, to the bit.
"""

import asyncio
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path

import cv2

from drivers.clock import NS_PER_S
from mission.attachments import flight_attachments
from mission.build import vision_settings
from mission.checks import Check
from mission.executive import Crew, Executive
from mission.flight import FlightOutcome, camera_words, stop_signals
from mission.hazards import ComputerView
from mission.journal import NoJournal
from mission.log.disk import log_path
from mission.log.recorder import Recorder
from mission.logbook import FlightPapers, Logbook
from mission.plan_file import MissionFile
from mission.records import TruePose
from mission.reporting import Progress
from mission.simulated.aftermath import Aftermath, contact_event
from mission.simulated.in_process import InProcessAutopilot
from mission.simulated.rendered_eyes import RenderedEyes
from mission.simulated.scenario import Scenario
from mission.simulated.simulation import true_line
from mission.simulated.virtual_time import VirtualClock, run_virtually
from mission.surroundings import free_bytes
from sitl.autopilot import SimAutopilot
from sitl.contact import Obstacles
from sitl.outfit import outfit
from sitl.render.photographer import Photographer
from sitl.render.renderer import Renderer
from sitl.vehicle import euler_of
from sitl.witness import Contact, Witness
from sitl.world.file import load_world

_PROGRESS_PERIOD_S = 1.0
_TRUTH_PERIOD_NS = NS_PER_S // 20


def fly_virtually(
    mission: MissionFile,
    scenario: Scenario,
    log_folder: Path,
    on_progress: Callable[[Progress], None],
    on_checks: Callable[[Sequence[Check]], None],
) -> tuple[FlightOutcome, Aftermath]:
    """Fly a mission in a scenario, and say how it ended.

    Raises WorldError, AirframeError, and LogError when the log cannot be made.
    """
    world = load_world(scenario.world, scenario.light)
    contacts: list[Contact] = []
    witness = Witness(Obstacles(world), contacts.append)
    plan, camera = mission.plan, mission.camera
    cv2.setNumThreads(1)  # the camera's and the vision's thread are two already
    sim = outfit(
        world,
        airframe=scenario.airframe,
        wind_m_s=scenario.wind_m_s,
        wind_from_rad=scenario.wind_from_rad,
        seed=scenario.seed,
        gust_fronts=scenario.has_gust_fronts,
        witness=witness,
    )
    photographer = Photographer(Renderer(world, camera, seed=scenario.seed))
    path = log_path(log_folder, plan.name, datetime.now(UTC))

    async def flight() -> tuple[FlightOutcome, float]:
        clock = VirtualClock()
        executive: Executive | None = None
        autopilot = InProcessAutopilot(clock, sim)
        recorder = Recorder(
            path,
            mission_text=mission.text,
            mission_name=plan.name,
            metadata={"command": "dry-run --virtual-time", "world": scenario.world or world.name}
            | scenario.metadata
            | camera_words(camera),
            clock=clock,
        )
        eyes = RenderedEyes(
            autopilot,
            lambda motion, seq: photographer.take(motion, seq).image,
            vision_settings(plan, camera),
            plan.camera.rate_hz,
            plan.vision.log_rate_hz,
            lambda: executive is None or executive.needs_vision,
        )
        with recorder, eyes:
            for item in (camera, *flight_attachments(mission, plan), true_line(world)):
                recorder.record(item)
            autopilot.after_step.append(_truth_recorder(sim, contacts, recorder))
            papers = FlightPapers(plan.name, str(mission.path), mission.sha256, "in-process", "dry-run", str(path))
            crew = Crew(
                autopilot,
                eyes,
                camera,
                recorder,
                Logbook(NoJournal(), papers),
                lambda: ComputerView(free_disk_bytes=room_bytes, log_failure=recorder.failure),
            )
            room_bytes = free_bytes(path.parent)
            executive = Executive(plan, crew, clock, None, on_checks)
            with stop_signals(executive.request_stop):
                showing = asyncio.create_task(_show(executive, on_progress))
                began_s = time.monotonic()
                try:
                    ended = await executive.run()
                finally:
                    showing.cancel()
                    await asyncio.gather(showing, return_exceptions=True)
                    await autopilot.close()
                wall_s = time.monotonic() - began_s
            on_progress(executive.progress)
        return FlightOutcome(ended, executive.may_have_armed, path, recorder.failure), sim.boot_s / wall_s

    outcome, speed = run_virtually(flight())
    return outcome, Aftermath(world, speed, witness.summary)


def _truth_recorder(sim: SimAutopilot, contacts: list[Contact], recorder: Recorder) -> Callable[[], None]:
    """What records the true pose twenty times a second, and `contacts` as they come."""
    next_ns = 0

    def record() -> None:
        nonlocal next_ns
        while contacts:
            recorder.record(contact_event(contacts.pop(0)))
        now_ns = round(sim.boot_s * NS_PER_S)
        if now_ns >= next_ns:
            next_ns += _TRUTH_PERIOD_NS
            recorder.record(TruePose(now_ns, *sim.vehicle.position_m, euler_of(sim.vehicle.quaternion)[2]))

    return record


async def _show(executive: Executive, on_progress: Callable[[Progress], None]) -> None:
    while True:
        on_progress(executive.progress)
        await asyncio.sleep(_PROGRESS_PERIOD_S)
