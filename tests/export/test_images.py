"""The image set: untouched JPEGs with true EXIF, and poses that put the world where the camera saw it."""

import csv
import io
import json
import math
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from PIL.ExifTags import GPS, IFD, Base

from drivers.camera.camera import Intrinsics
from drivers.clock import NS_PER_S
from mission.autopilot import GlobalPoint, VehicleState
from mission.export.colmap import camera_lines
from mission.export.errors import ExportError
from mission.export.exif import Shot, focal_35mm, with_exif
from mission.export.images import ImageSet, camera_of, export_images
from mission.export.poses import Floats
from mission.log.errors import LogError
from mission.log.reader import Flight, read_images
from mission.records import Attachment
from tests.export.exported_flight import write_flight
from tests.export.test_poses import rotation_matrix
from tests.log.synthetic_flight import CAMERA, LINE, ORIGIN, START_NS, draw_ground, fly, write_log

SHOT = Shot(1_767_225_599_120_000_000, GlobalPoint(math.radians(-4.9), math.radians(-73.9), -2.5), -math.pi / 2, CAMERA)


@pytest.fixture(scope="module")
def exported(flight: Flight, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("images") / "out"
    n_images = sum(1 for _ in read_images(flight))
    assert export_images(flight.path, folder) == ImageSet(n_images, 0, has_gps=True)
    return folder


def poses(folder: Path) -> dict[str, dict[str, str]]:
    with (folder / "poses.csv").open(encoding="utf-8", newline="") as rows:
        return {row["name"]: row for row in csv.DictReader(rows)}


def colmap_images(folder: Path) -> dict[str, tuple[Floats, Floats]]:
    """Name -> rotation matrix and translation of camera_from_world, of images.txt."""
    lines = [line for line in (folder / "sparse/0/images.txt").read_text().split("\n") if not line.startswith("#")]
    assert set(lines[1::2]) == {""}  # no points
    images = {}
    for image_id, line in enumerate(lines[0:-1:2], start=1):
        number, qw, qx, qy, qz, *translation, camera_id, name = line.split()
        assert (number, camera_id) == (str(image_id), "1")
        w, axis = float(qw), np.array([qx, qy, qz], dtype=float)
        assert w * w + axis @ axis == pytest.approx(1.0)
        cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        matrix = np.eye(3) + 2 * w * cross + 2 * cross @ cross
        images[name] = matrix, np.array(translation, dtype=float)
    return images


def dms_deg(parts: tuple[float, float, float], ref: str) -> float:
    degrees, minutes, seconds = map(float, parts)
    return (degrees + minutes / 60 + seconds / 3600) * (-1 if ref in "SW" else 1)


def test_the_images_are_those_of_the_log_but_for_their_exif(flight: Flight, exported: Path) -> None:
    files = sorted((exported / "images").iterdir())
    for file, (_, jpeg) in zip(files, read_images(flight), strict=True):
        written = file.read_bytes()
        assert written[:4] == b"\xff\xd8\xff\xe1"
        length = int.from_bytes(written[4:6], "big")
        assert written[4 + length :] == jpeg[2:]
        with Image.open(io.BytesIO(written)) as after, Image.open(io.BytesIO(jpeg)) as before:
            np.testing.assert_array_equal(np.asarray(after), np.asarray(before))
        seen = cv2.imdecode(np.frombuffer(written, np.uint8), cv2.IMREAD_COLOR)
        np.testing.assert_array_equal(seen, cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR))


def test_exif_tells_when_and_where(flight: Flight, exported: Path) -> None:
    rows = poses(exported)
    truth = {pose.t_ns: pose for pose in flight.truth}
    for file in sorted((exported / "images").iterdir())[::5]:
        row = rows[file.name]
        with Image.open(file) as image:
            exif = image.getexif()
        details, gps = exif.get_ifd(IFD.Exif), exif.get_ifd(IFD.GPSInfo)
        taken = datetime.strptime(details[Base.DateTimeOriginal], "%Y:%m:%d %H:%M:%S").replace(tzinfo=UTC)
        milliseconds = int(taken.timestamp()) * 1000 + int(details[Base.SubsecTimeOriginal])
        assert milliseconds == int(row["unix_ns"]) // 1_000_000
        assert details[Base.OffsetTimeOriginal] == "+00:00"
        assert dms_deg(gps[GPS.GPSLatitude], gps[GPS.GPSLatitudeRef]) == pytest.approx(
            float(row["latitude_deg"]), abs=1e-8
        )
        assert dms_deg(gps[GPS.GPSLongitude], gps[GPS.GPSLongitudeRef]) == pytest.approx(
            float(row["longitude_deg"]), abs=1e-8
        )
        pose = truth[int(row["unix_ns"]) - flight.mission.unix_minus_flight_ns]
        assert float(gps[GPS.GPSAltitude]) == pytest.approx(ORIGIN.altitude_m - pose.down_m, abs=2e-3)
        assert float(gps[GPS.GPSImgDirection]) == pytest.approx(math.degrees(pose.yaw_rad) % 360, abs=0.01)
        assert gps[GPS.GPSImgDirectionRef] == "T"
        assert exif[Base.Make] == exif[Base.Model] == "lineflight"


def test_exif_in_the_south_west_below_the_sea() -> None:
    with Image.open(io.BytesIO(with_exif(draw_ground(1, []), SHOT))) as image:
        exif = image.getexif()
    details, gps = exif.get_ifd(IFD.Exif), exif.get_ifd(IFD.GPSInfo)
    assert (details[Base.DateTimeOriginal], details[Base.SubsecTimeOriginal]) == ("2025:12:31 23:59:59", "120")
    assert (gps[GPS.GPSDateStamp], [float(part) for part in gps[GPS.GPSTimeStamp]]) == ("2025:12:31", [23, 59, 59.12])
    assert dms_deg(gps[GPS.GPSLatitude], gps[GPS.GPSLatitudeRef]) == pytest.approx(-4.9, abs=1e-8)
    assert dms_deg(gps[GPS.GPSLongitude], gps[GPS.GPSLongitudeRef]) == pytest.approx(-73.9, abs=1e-8)
    assert (gps[GPS.GPSAltitudeRef], float(gps[GPS.GPSAltitude]), float(gps[GPS.GPSImgDirection])) == (b"\1", 2.5, 270)
    assert details[Base.FocalLengthIn35mmFilm] == focal_35mm(CAMERA) == 27  # 500 px of 800 px, of 43.27 mm


@given(latitude_deg=st.floats(-90, 90), longitude_deg=st.floats(-180, 180))
def test_any_place_on_earth_survives_exif(latitude_deg: float, longitude_deg: float) -> None:
    place = GlobalPoint(math.radians(latitude_deg), math.radians(longitude_deg), 0.0)
    exif = Image.Exif()
    content = with_exif(b"\xff\xd8", replace(SHOT, place=place))
    exif.load(content[6:])
    gps = exif.get_ifd(IFD.GPSInfo)
    for tag, ref, expected in (
        (GPS.GPSLatitude, GPS.GPSLatitudeRef, latitude_deg),
        (GPS.GPSLongitude, GPS.GPSLongitudeRef, longitude_deg),
    ):
        assert dms_deg(gps[tag], gps[ref]) == pytest.approx(expected, abs=1e-8)
        assert all(float(part) < 60 for part in gps[tag][1:])


def test_the_poses_put_the_conductors_where_the_camera_saw_them(flight: Flight, exported: Path) -> None:
    conductor = np.array(LINE.conductors_ned_m[0])
    enu_m = np.stack([conductor[:, 1], conductor[:, 0], -conductor[:, 2]], axis=1)
    model = (exported / "sparse/0/cameras.txt").read_text().splitlines()[1].split()
    assert model[:4] == ["1", "PINHOLE", "640", "480"]
    fx, fy, cx, cy = map(float, model[4:])
    matrix = np.array([[fx, 0, cx - 0.5], [0, fy, cy - 0.5], [0, 0, 1]])  # the first pixel's centre at (0, 0) again
    states = {state.t_ns: state for state in flight.states}
    rows = poses(exported)
    n_seen = 0
    for name, (rotation, translation) in colmap_images(exported).items():
        state = states[int(rows[name]["unix_ns"]) - flight.mission.unix_minus_flight_ns]
        place = np.array([state.north_m, state.east_m, state.down_m])
        # Independently: the body sees forward, right, down; the image's right is right, its top forward.
        forward, right, down = rotation_matrix(state.roll_rad, state.pitch_rad, state.yaw_rad).T @ (conductor - place).T
        is_ahead = down > 1.0
        if not is_ahead.any():
            continue
        expected = np.stack([CAMERA.cx_px + CAMERA.fx_px * right / down, CAMERA.cy_px - CAMERA.fy_px * forward / down])
        rvec, _ = cv2.Rodrigues(rotation)
        seen, _ = cv2.projectPoints(enu_m[is_ahead], rvec, translation, matrix, None)
        np.testing.assert_allclose(seen[:, 0], expected.T[is_ahead], atol=1e-3)
        n_seen += 1
    assert n_seen > 10


def test_poses_csv_says_the_same_as_the_model(exported: Path) -> None:
    rows = poses(exported)
    models = colmap_images(exported)
    assert list(rows) == list(models) == sorted(file.name for file in (exported / "images").iterdir())
    for name, (rotation, translation) in models.items():
        row = rows[name]
        centre = -rotation.T @ translation
        np.testing.assert_allclose(
            centre, [float(row["east_m"]), float(row["north_m"]), -float(row["down_m"])], atol=1e-4
        )
        w, x, y, z = (float(row[f"enu_from_camera_{part}"]) for part in "wxyz")
        view = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])  # the lens' direction
        np.testing.assert_allclose(rotation.T @ [0, 0, 1], view, atol=1e-9)
        assert view[2] < -0.99  # down


@pytest.mark.parametrize(
    ("camera", "expected"),
    [
        (CAMERA, "PINHOLE 640 480 500.0 500.0 320.0 240.0"),
        (
            replace(CAMERA, distortion=(0.1, 0.2, 0.3, 0.4, 0.0)),
            "OPENCV 640 480 500.0 500.0 320.0 240.0 0.1 0.2 0.3 0.4",
        ),
        (
            replace(CAMERA, distortion=(0.1, 0.2, 0.3, 0.4, 0.5)),
            "FULL_OPENCV 640 480 500.0 500.0 320.0 240.0 0.1 0.2 0.3 0.4 0.5 0.0 0.0 0.0",
        ),
        (
            replace(CAMERA, lens="fisheye", distortion=(0.1, 0.2, 0.3, 0.4)),
            "OPENCV_FISHEYE 640 480 500.0 500.0 320.0 240.0 0.1 0.2 0.3 0.4",
        ),
    ],
)  # fmt: skip
def test_every_lens_has_its_colmap_model(camera: Intrinsics, expected: str) -> None:
    assert camera_lines(camera).splitlines()[1] == f"1 {expected}"


def test_frames_are_taken_by_task_and_thinned_under_their_own_names(
    flight: Flight, exported: Path, folder: Path, tmp_path: Path
) -> None:
    every_name = list(poses(exported))
    export_images(flight.path, folder, every=3)
    assert list(poses(folder)) == every_name[::3]
    export_images(flight.path, tmp_path / "task", task="follow_lines", every=2)
    starts_ns = {started.t_ns: started.task for started in flight.tasks_started}
    taken = poses(tmp_path / "task")
    expected = [
        name
        for name, row in poses(exported).items()
        for t_ns in (int(row["unix_ns"]) - flight.mission.unix_minus_flight_ns,)
        if starts_ns[max(start for start in starts_ns if start <= t_ns)] == "follow_lines"
    ]
    assert list(taken) == expected[::2]
    assert len(taken) >= 3


def test_a_task_that_was_not_flown_is_refused(flight: Flight, folder: Path) -> None:
    with pytest.raises(ExportError, match="tasks flown are: takeoff, ascend"):
        export_images(flight.path, folder, task="loop")
    assert not folder.exists()


def test_without_an_origin_images_have_no_gps(flight_without_origin: Flight, folder: Path) -> None:
    written = export_images(flight_without_origin.path, folder)
    assert not written.has_gps
    for file in (folder / "images").iterdir():
        with Image.open(file) as image:
            assert image.getexif().get_ifd(IFD.GPSInfo) == {}
            assert image.getexif().get_ifd(IFD.Exif)[Base.FocalLengthIn35mmFilm] == 27
    assert {row["latitude_deg"] for row in poses(folder).values()} == {""}
    assert "did not tell where on Earth" in (folder / "README.txt").read_text()


def test_frames_without_a_pose_are_left_out(flight: Flight, folder: Path, tmp_path: Path) -> None:
    first_state_ns = START_NS + 30 * NS_PER_S
    path = tmp_path / "deaf.mcap"
    camera = Attachment("camera.json", "application/json", flight.attachments["camera.json"])
    heard = [(t_ns, item) for t_ns, item in fly() if not isinstance(item, VehicleState) or t_ns >= first_state_ns]
    write_log(path, [(START_NS, camera), *heard])
    written = export_images(path, folder)
    times_ns = [t_ns for t_ns, _ in read_images(flight)]
    n_before = sum(t_ns < first_state_ns - NS_PER_S // 4 for t_ns in times_ns)
    assert written.n_without_pose == n_before > 0
    assert written.n_images == len(times_ns) - n_before == len(list((folder / "images").iterdir()))


def test_older_logs_tell_the_camera_in_their_metadata(flight: Flight) -> None:
    older = replace(flight.mission, metadata={"camera_intrinsics": json.dumps(asdict(CAMERA))})
    assert camera_of(replace(flight, attachments={}, mission=older)) == CAMERA
    assert camera_of(flight) == CAMERA
    with pytest.raises(ExportError, match="does not tell"):
        camera_of(replace(flight, attachments={}))
    with pytest.raises(LogError, match="cannot be read"):
        camera_of(replace(flight, attachments={"camera.json": b'{"width_px": 1}'}))


def test_a_log_without_a_camera_or_frames_is_refused(tmp_path: Path, folder: Path) -> None:
    path = tmp_path / "blind.mcap"
    write_flight(path, camera=None)
    with pytest.raises(ExportError, match="intrinsics"):
        export_images(path, folder)
    assert not folder.exists()


def test_what_is_no_jpeg_is_refused() -> None:
    with pytest.raises(ExportError, match="JPEG"):
        with_exif(b"\x89PNG", SHOT)
