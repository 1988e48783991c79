"""A flight's photographs with their poses, as programs for 3D reconstruction take them."""

import csv
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drivers.camera.camera import Intrinsics
from mission.autopilot import GlobalPoint
from mission.export.colmap import camera_lines, image_lines, point_lines
from mission.export.errors import ExportError
from mission.export.exif import Shot, with_exif
from mission.export.flight_map import global_origin, places_deg
from mission.export.frames import photographs
from mission.export.output import new_folder
from mission.export.poses import ENU_FROM_NED, FRD_FROM_CAMERA, Floats, Poses, Track, inverse, product
from mission.geodesy import points_at
from mission.log.reader import Flight, read_flight

_POSE_COLUMNS = (
    "name", "unix_ns", "north_m", "east_m", "down_m",
    "enu_from_camera_w", "enu_from_camera_x", "enu_from_camera_y", "enu_from_camera_z",
    "roll_deg", "pitch_deg", "yaw_deg", "latitude_deg", "longitude_deg", "altitude_m",
)  # fmt: skip

_README = """\
Photographs of the flight {mission}, from {log}, written by lineflight.

images/    The frames as the log holds them, with EXIF: time (UTC), focal length (35 mm equivalent){gps}.
sparse/0/  The camera and the poses in COLMAP's text format, without points. World: ENU, x east, y north, z up [m].
           Its origin is that of the autopilot's local frame: {origin}.
poses.csv  The same poses: the vehicle's place (local NED [m]; WGS-84, altitude above mean sea level), its attitude,
           and the camera's rotation to ENU as a quaternion w, x, y, z. Camera: x right, y down, z out of the lens.

COLMAP triangulates points with these poses so (a new database numbers the images as sparse/0/images.txt does):

  colmap feature_extractor --database_path new.db --image_path images --ImageReader.single_camera 1 \\
    --ImageReader.camera_model {model} --ImageReader.camera_params {parameters}
  colmap sequential_matcher --database_path new.db
  mkdir triangulated
  colmap point_triangulator --database_path new.db --image_path images --input_path sparse/0 --output_path triangulated

The poses are the autopilot's estimates, interpolated to the middle of each exposure: decimetres to metres from the
truth, depending on its GPS. The camera is taken to look straight down, the image's top forward, from the very point
whose position the autopilot estimates.
"""


@dataclass(frozen=True, slots=True)
class ImageSet:
    """What was written: how many photographs, how many were left out without a pose, and whether they have GPS."""

    n_images: int
    n_without_pose: int
    has_gps: bool


def camera_of(flight: Flight) -> Intrinsics:
    """The intrinsics of the camera that the flight was flown with. Raises ExportError where the log lacks them."""
    camera = flight.camera
    if camera is None:
        raise ExportError(f"{flight.path} does not tell the camera's intrinsics; its images are of no use to COLMAP.")
    return camera


def export_images(
    log: Path,
    folder: Path,
    *,
    task: str | None = None,
    every: int = 1,
    on_image: Callable[[], None] = lambda: None,
) -> ImageSet:
    """Write the frames of a log, or every `every`th of those taken in `task`, with their poses into `folder`.

    Frames without a state of the vehicle near them are left out. Raises LogError; ExportError when the log lacks what
    is needed, no frame is left, or `folder` is not empty; OutputError when it cannot be written.
    """
    flight = read_flight(log)
    camera, origin, track = camera_of(flight), global_origin(flight), Track(flight.states)
    offset_ns = flight.mission.unix_minus_flight_ns
    names: list[str] = []
    times_ns: list[int] = []
    n_without_pose = 0
    with new_folder(folder) as unfinished:
        images = unfinished / "images"
        images.mkdir()
        for photograph in photographs(flight, task=task, every=every):
            pose = track.at([photograph.t_ns])
            if not pose.is_known[0]:
                n_without_pose += 1
                continue
            place = None if origin is None else GlobalPoint(*points_at(pose.ned_m, origin)[0].tolist())
            shot = Shot(photograph.t_ns + offset_ns, place, float(pose.attitude_rad[0, 2]), camera)
            (images / photograph.name).write_bytes(with_exif(photograph.jpeg, shot))
            names.append(photograph.name)
            times_ns.append(photograph.t_ns)
            on_image()
        if not names:
            raise ExportError(_why_none(log, task, n_without_pose))
        poses = track.at(times_ns)
        enu_from_camera = _enu_from_camera(poses)
        model = unfinished / "sparse" / "0"
        model.mkdir(parents=True)
        (model / "cameras.txt").write_text(camera_lines(camera))
        (model / "images.txt").write_text(image_lines(names, inverse(enu_from_camera), _enu(poses.ned_m)))
        (model / "points3D.txt").write_text(point_lines())
        unix_ns = [t_ns + offset_ns for t_ns in times_ns]
        _write_poses(unfinished / "poses.csv", _pose_rows(names, unix_ns, poses, enu_from_camera, origin))
        (unfinished / "README.txt").write_text(_readme(flight, camera, origin), encoding="utf-8")
    return ImageSet(len(names), n_without_pose, origin is not None)


def _enu(ned_m: Floats) -> Floats:
    north_m, east_m, down_m = ned_m.T
    return np.stack([east_m, north_m, -down_m], axis=1)


def _enu_from_camera(poses: Poses) -> Floats:
    rotation = product(ENU_FROM_NED, product(poses.ned_from_frd, FRD_FROM_CAMERA))
    rotation *= np.where(rotation[:, :1] < 0, -1.0, 1.0)  # of the two quaternions of a rotation, that with w >= 0
    return rotation


def _pose_rows(
    names: list[str], unix_ns: list[int], poses: Poses, enu_from_camera: Floats, origin: GlobalPoint | None
) -> Iterator[list[str | int]]:
    attitudes_deg = np.degrees(np.arctan2(np.sin(poses.attitude_rad), np.cos(poses.attitude_rad)))
    places = None if origin is None else places_deg(poses.ned_m, origin)
    for k, (name, t_ns) in enumerate(zip(names, unix_ns, strict=True)):
        on_earth = ["", "", ""]
        if places is not None:
            latitude_deg, longitude_deg, altitude_m = places[k].tolist()
            on_earth = [f"{latitude_deg:.9f}", f"{longitude_deg:.9f}", f"{altitude_m:.4f}"]
        yield [
            name,
            t_ns,
            *(f"{number:.4f}" for number in poses.ned_m[k].tolist()),
            *(f"{number:.12g}" for number in enu_from_camera[k].tolist()),
            *(f"{number:.4f}" for number in attitudes_deg[k].tolist()),
            *on_earth,
        ]


def _write_poses(file: Path, rows: Iterator[list[str | int]]) -> None:
    with file.open("w", encoding="utf-8", newline="") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(_POSE_COLUMNS)
        writer.writerows(rows)


def _readme(flight: Flight, camera: Intrinsics, origin: GlobalPoint | None) -> str:
    _, line = camera_lines(camera).splitlines()
    _, model, _, _, *parameters = line.split()
    where = "the autopilot did not tell where on Earth that is"
    if origin is not None:
        latitude_deg, longitude_deg, altitude_m = places_deg(np.zeros((1, 3)), origin)[0].tolist()
        where = f"{latitude_deg:.8f}, {longitude_deg:.8f}, {altitude_m:.2f} m above mean sea level"
    return _README.format(
        mission=flight.mission.name,
        log=flight.path.name,
        gps="; no place, which the log does not tell" if origin is None else ", place and heading",
        origin=where,
        model=model,
        parameters=",".join(parameters),
    )


def _why_none(log: Path, task: str | None, n_without_pose: int) -> str:
    if n_without_pose:
        return f"{log} holds {n_without_pose} frames, but no state of the vehicle near them: none of them has a pose."
    if task is not None:
        return f"{log} holds no frame that was taken in the task {task}."
    return f"{log} holds no frames; a mission with vision.log_rate_hz above 0 keeps them."
