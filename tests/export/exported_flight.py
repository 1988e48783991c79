"""The synthetic flight as a log with a camera, with and without an origin."""

import json
from dataclasses import asdict
from pathlib import Path

from drivers.camera.camera import Intrinsics
from mission.log.reader import Flight, read_flight
from mission.records import Attachment, Origin
from tests.log.synthetic_flight import CAMERA, START_NS, fly, write_log


def write_flight(path: Path, *, has_origin: bool = True, camera: Intrinsics | None = CAMERA) -> Flight:
    """Write the log of a flight, and read it."""
    records = [(t_ns, item) for t_ns, item in fly() if has_origin or not isinstance(item, Origin)]
    if camera is not None:
        attachment = Attachment("camera.json", "application/json", json.dumps(asdict(camera)).encode())
        records.insert(0, (START_NS, attachment))
    assert write_log(path, records).failure is None
    return read_flight(path)
