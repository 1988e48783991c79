"""Run today's vision on the frames that a log kept."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np

from drivers.camera.camera import Frame
from mission.log.reader import Flight, read_images
from vision.pipeline import LineFinder, VisionSettings
from vision.records import VisionReport
from vision.worker_process import Reporter


@dataclass(slots=True)
class _CaptureClock:
    """Shows the time at which a frame was taken: a report's age is the log's, not today's."""

    t_ns: int = 0

    def now_ns(self) -> int:
        """That time [ns]."""
        return self.t_ns

    def wall_s(self, flight_s: float) -> float:
        """Nobody waits by this clock."""
        return 0.0


def replay_vision(
    flight: Flight, settings: VisionSettings, on_frame: Callable[[], None] = lambda: None
) -> Iterator[VisionReport]:
    """Today's report of each frame that the log holds, in the order of their times; latencies are the flight's own.

    The same frames give the same reports. The tracker sees the kept frames only, of which a log has fewer than the
    flight had; and those as JPEG: what it makes of them may differ from what the flight made of the frames themselves.
    Raises LogError when the log cannot be read any more.
    """
    flown = {report.t_capture_ns: report for report in flight.reports}
    clock = _CaptureClock()
    finder = LineFinder(settings)
    finder.warm_up()
    reporter = Reporter(finder, clock, 0.0)
    for t_ns, jpeg in read_images(flight):
        report = flown.get(t_ns)
        image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_UNCHANGED)
        if report is None or image is None:
            continue
        image.setflags(write=False)
        clock.t_ns = t_ns + report.latency_ns
        # Wall time would make two replays differ.
        yield replace(reporter.report(Frame(report.seq, t_ns, np.asarray(image, dtype=np.uint8))), work_ns=0)
        on_frame()
