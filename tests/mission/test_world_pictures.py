"""`lineflight world render | dataset | replay`: what they write, and what they answer to bad input."""

import csv
import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner, Result

from mission.autopilot import FlightMode, LandedState, VehicleState
from mission.log.reader import Flight
from mission.log.records import LoggedMission
from mission.records import Result as TaskResult
from mission.records import TaskEnded, TaskStarted, TruePose
from mission.simulated.pictures import DatasetSettings, PicturesError, make_dataset, scaled
from mission.simulated.replay import RATE_HZ, clock, track_of, world_of, write_video
from mission.simulated.world_pictures import app
from sitl.render.lens import ned_from_body, pinhole
from sitl.render.truth.files import FARTHEST_M, depth_millimetres
from sitl.render.truth.sampling import sample_view
from sitl.world.extent import distances_m
from sitl.world.file import WorldError, load_world
from sitl.world.surface import surface_of
from vision.records import Track, VisionReport

S_NS = 1_000_000_000
SMALL = ("--size", "160x120")


def ran(*arguments: str | Path) -> Result:
    """Run `lineflight world ARGUMENTS`; the command's own exit code, and no traceback."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def assert_refused(result: Result, words: str) -> None:
    """Exit code 2, and one sentence with these words."""
    assert result.exit_code == 2
    assert words in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert result.stderr.strip().endswith(".")


def test_render_writes_the_picture_and_its_truth(tmp_path: Path) -> None:
    out = tmp_path / "new" / "a.png"
    result = ran("render", "medium_voltage", "--pose", "14,-3.5,-14,110,-6,3", "--out", out, "--truth", *SMALL)
    assert result.exit_code == 0
    names = ["a.png", "a_mask.png", "a_depth.png", "a_lines.json", "a_boxes.json"]
    assert sorted(path.name for path in out.parent.iterdir()) == sorted(names)
    assert [Path(line).name for line in result.stdout.split()] == names
    image, mask = cv2.imread(str(out)), cv2.imread(str(out.with_name("a_mask.png")), cv2.IMREAD_UNCHANGED)
    depth_mm = cv2.imread(str(out.with_name("a_depth.png")), cv2.IMREAD_UNCHANGED)
    assert image.shape == (120, 160, 3)
    assert 70 < image.mean() < 130
    assert set(np.unique(mask)) == {0, 1, 2}
    assert depth_mm.dtype == np.uint16
    assert np.median(depth_mm[mask == 0]) == pytest.approx(14_000, rel=0.1)
    assert np.median(depth_mm[mask == 1]) == pytest.approx(4_000, rel=0.25)
    assert len(json.loads(out.with_name("a_lines.json").read_text())) == 3
    categories = [entry["category"] for entry in json.loads(out.with_name("a_boxes.json").read_text())]
    assert sorted(set(categories)) == ["concrete_pole", "conductor"]


def test_the_front_camera_sees_the_sky(tmp_path: Path) -> None:
    out = tmp_path / "a.png"
    options = ("--pose", "11.3,4.1,-14,110", "--camera", "front", "--out", out, "--truth", *SMALL)
    assert ran("render", "medium_voltage", *options).exit_code == 0
    depth_mm = cv2.imread(str(tmp_path / "a_depth.png"), cv2.IMREAD_UNCHANGED)
    assert (depth_mm[:20] == 0).all()
    assert (depth_mm[-20:] > 0).all()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nowhere", "--pose", "0,0,-9,0"), "There is no world 'nowhere'"),
        (("medium_voltage", "--pose", "0,0,9"), "--pose is '0,0,9'"),
        (("medium_voltage", "--pose", "0,0,-9,nan"), "--pose is"),
        (("medium_voltage", "--pose", "0,0,9,0"), "The pose is 9.00 m below"),
        (("medium_voltage", "--pose", "0,0,-9,0", "--size", "640"), "--size is '640'"),
        (("medium_voltage", "--pose", "0,0,-9,0", "--out", "a.gif"), "--out is 'a.gif'"),
    ],
)
def test_render_refuses_bad_input(arguments: tuple[str, ...], words: str) -> None:
    assert_refused(ran("render", *arguments), words)


def test_a_picture_that_cannot_be_written_is_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    out = tmp_path / "file" / "a.png"
    assert_refused(ran("render", "medium_voltage", "--pose", "0,0,-9,0", "--out", out, *SMALL), "cannot be written")


def settings_for(out: Path, seed: int = 5) -> DatasetSettings:
    return DatasetSettings(
        "medium_voltage", out, 3, seed, ("down", "front"), None, "both", 160, 120, math.radians(80.0), is_jpeg=False
    )


def test_a_dataset_holds_what_its_indexes_say_and_is_the_same_again(tmp_path: Path) -> None:
    done: list[None] = []
    make_dataset(settings_for(tmp_path / "a"), lambda: done.append(None))
    make_dataset(settings_for(tmp_path / "b"), lambda: None)
    assert len(done) == 3
    files = sorted(path.relative_to(tmp_path / "a") for path in (tmp_path / "a").rglob("*") if path.is_file())
    assert len(files) == 3 * 5 + 3
    for file in files:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes(), file

    index = json.loads((tmp_path / "a" / "instances.json").read_text())
    assert [image["file_name"] for image in index["images"]] == ["000000.png", "000001.png", "000002.png"]
    assert [entry["id"] for entry in index["annotations"]] == list(range(1, len(index["annotations"]) + 1))
    assert index["annotations"]
    for k, image in enumerate(index["images"]):
        own = [entry for entry in index["annotations"] if entry["image_id"] == image["id"]]
        mask = cv2.imread(str(tmp_path / "a" / "masks" / f"{k:06d}.png"), cv2.IMREAD_UNCHANGED)
        assert sum(entry["area"] for entry in own) <= (mask > 0).sum()
        assert len((tmp_path / "a" / "labels" / f"{k:06d}.txt").read_text().splitlines()) == len(own)
    with (tmp_path / "a" / "poses.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["camera"] for row in rows] == ["down", "front", "down"]
    assert float(rows[0]["fx_px"]) == pytest.approx(pinhole(160, 120, math.radians(80.0)).fx_px)
    names = (tmp_path / "a" / "data.yaml").read_text()
    assert "0: conductor" in names

    with pytest.raises(PicturesError, match="is not empty"):
        make_dataset(settings_for(tmp_path / "a"), lambda: None)


def test_dataset_refuses_bad_input(tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("x")
    assert_refused(ran("dataset", "medium_voltage", "--out", tmp_path / "full"), "is not empty")
    assert_refused(ran("dataset", "nowhere", "--out", tmp_path / "new"), "There is no world 'nowhere'")
    assert not (tmp_path / "new").exists()
    assert_refused(ran("dataset", "medium_voltage", "--out", tmp_path / "full" / "mine.txt"), "cannot be written")


def test_views_are_over_the_line_and_upright() -> None:
    world = load_world()
    axis = np.array(world.line.axis_ne_m)
    for index in range(200):
        view = sample_view(world, surface_of(world), "down", np.random.default_rng((1, index)))
        pose = view.motion.pose
        assert 4.0 <= -pose.down_m - 7.0 <= 20.0
        assert np.hypot(*(axis - [pose.north_m, pose.east_m]).T).min() < 45.0 + 20.0
        assert ned_from_body(pose)[2, 2] > math.cos(math.radians(30.0))
        assert np.linalg.norm(view.motion.velocity_ned_m_s) < 9.0
        assert view == sample_view(world, surface_of(world), "down", np.random.default_rng((1, index)))


def test_views_may_be_asked_for_over_the_line_at_one_height() -> None:
    world = load_world()
    tops_m = [-support.top_ned_m[2] for support in world.supports]
    for index in range(50):
        rng = np.random.default_rng((2, index))
        pose = sample_view(world, surface_of(world), "down", rng, (5.0, 5.0), 0.0).motion.pose
        assert distances_m(np.array([[pose.north_m, pose.east_m]]), np.array(world.line.axis_ne_m))[0] < 1e-6
        assert min(tops_m) - 1.0 < -pose.down_m - 5.0 < max(tops_m) + 1.0  # 1 m below: the sag


def test_a_depth_file_is_in_millimetres_and_0_where_it_cannot_tell() -> None:
    depth_m = np.array([[0.5, 6.1234, FARTHEST_M, 65.6, np.inf]], dtype=np.float32)
    assert depth_millimetres(depth_m).tolist() == [[500, 6123, 65535, 0, 0]]


def flight_of(path: Path, metadata: dict[str, str]) -> Flight:
    """Two seconds of flight along the line, northwards at first, with one report."""
    truth = tuple(
        TruePose(
            S_NS + k * S_NS // 20, 8.0 + 0.1 * k, 4.0, -15.0, math.pi + (0.02 * k if k < 20 else 0.02 * k - math.tau)
        )
        for k in range(41)
    )
    state = VehicleState(
        t_ns=S_NS, north_m=9.0, east_m=9.0, down_m=-9.0, v_north_m_s=0.0, v_east_m_s=0.0, v_down_m_s=0.0,
        roll_rad=0.1, pitch_rad=-0.2, yaw_rad=3.0, mode=FlightMode.OFFBOARD, is_armed=True, landed=LandedState.IN_AIR,
        battery=0.9, is_connected=True,
    )  # fmt: skip
    lines = np.array([[20.0, 0.0, 20.0, 470.0]])
    report = VisionReport(0, 2 * S_NS, None, Track.TRACKING, None, lines, 0, 0, 0, None)
    return Flight(
        path=path,
        mission=LoggedMission("x", "", "", S_NS, 0, metadata),
        checks=(),
        states=(state,),
        setpoints=(),
        fixes=(),
        reports=(report,),
        tasks_started=(TaskStarted(S_NS, 0, "follow_lines"),),
        tasks_ended=(TaskEnded(3 * S_NS, 0, "follow_lines", TaskResult.COMPLETED, "done"),),
        mission_ended=None,
        events=(),
        status_texts=(),
        truth=truth,
        line=None,
        origin=None,
        start=None,
        targets=(),
        ticks=(),
        syncs=(),
        health=(),
        attachments={},
        image_times_ns=frozenset(),
        imported=None,
        reference_estimates=(),
        reference_setpoints=(),
        end_ns=3 * S_NS,
        is_truncated=False,
    )


def test_a_flight_is_replayed_frame_by_frame(tmp_path: Path) -> None:
    camera = {"width_px": 640, "height_px": 480, "fx_px": 380.0, "fy_px": 380.0, "cx_px": 319.5, "cy_px": 239.5,
              "distortion": [0.0] * 5, "lens": "pinhole"}  # fmt: skip
    flight = flight_of(tmp_path / "a.mcap", {"world": "medium_voltage", "camera_intrinsics": json.dumps(camera)})
    heard: list[tuple[int, int]] = []
    out = tmp_path / "new" / "a.mp4"
    world = world_of(flight, None, None)
    n_frames = write_video(flight, world, out, "both", (160, 120), lambda done, total: heard.append((done, total)))
    assert n_frames == 1 + 2 * RATE_HZ
    assert heard[-1] == (n_frames, n_frames)
    video = cv2.VideoCapture(str(out))
    frames = []
    while (read := video.read())[0]:
        frames.append(read[1])
    assert len(frames) == n_frames
    assert video.get(cv2.CAP_PROP_FPS) == RATE_HZ
    assert frames[0].shape == (150, 320, 3)
    # The report of the first second's end is drawn around its time, and not far from it.
    is_drawn = [_orange(frame[20:100, 2:8]) for frame in frames]
    assert is_drawn[25]
    assert not is_drawn[0]
    assert not is_drawn[50]


def test_a_hole_in_the_log_is_not_flown_through(tmp_path: Path) -> None:
    whole = flight_of(tmp_path / "a.mcap", {"world": "medium_voltage"})
    holed = replace(whole, reports=(), truth=whole.truth[:11] + whole.truth[35:])  # from 0.5 s to 1.75 s
    pictures, bars = [], []
    out = tmp_path / "a.mp4"
    assert write_video(holed, world_of(whole, None, None), out, "down", (160, 120), lambda *_: None) == 51
    video = cv2.VideoCapture(str(out))
    while (read := video.read())[0]:
        pictures.append(read[1][40:116].astype(float))  # without the map
        bars.append(read[1][122:150, :120].astype(float))  # without the clock
    moved = [float(np.abs(after - before).mean()) for before, after in pairwise(pictures)]
    assert max(moved[14:42]) < 0.3 * min(moved[2:11])
    assert moved[43] > 3.0 * max(moved[14:42])
    assert np.abs(bars[30] - bars[8]).mean() > 5.0  # other words
    assert np.abs(bars[48] - bars[8]).mean() < 2.0


def test_a_short_gap_of_telemetry_is_no_hole(tmp_path: Path) -> None:
    whole = flight_of(tmp_path / "a.mcap", {})
    track = track_of(replace(whole, truth=whole.truth[:11] + whole.truth[30:]))  # 0.95 s
    assert all(track.is_told_at(0.04 * k) for k in range(51))
    track = track_of(replace(whole, truth=whole.truth[:11] + whole.truth[35:]))
    assert [track.is_told_at(t_s) for t_s in (0.0, 0.5, 0.52, 1.74, 1.75, 2.0)] == [
        True,
        True,
        False,
        False,
        True,
        True,
    ]


def test_the_clock_counts_from_the_first_task() -> None:
    assert [clock(t_s) for t_s in (-2.54, -0.01, 0.0, 59.97, 61.0)] == [
        "-0:02.5",
        "0:00.0",
        "0:00.0",
        "1:00.0",
        "1:01.0",
    ]


def _orange(patch: np.ndarray) -> bool:
    blue, _, red = patch.reshape(-1, 3).mean(axis=0)
    return bool(red - blue > 60)


def test_poses_are_the_true_ones_with_the_tilt_that_was_told(tmp_path: Path) -> None:
    track = track_of(flight_of(tmp_path / "a.mcap", {}))
    pose = track.pose_at(0.975)  # between two poses, across the turn from pi to -pi
    assert (pose.north_m, pose.east_m, pose.down_m) == pytest.approx((9.95, 4.0, -15.0))
    assert math.remainder(pose.yaw_rad - (math.pi + 0.39), math.tau) == pytest.approx(0.0, abs=1e-9)
    assert pose.t_ns == S_NS + 975_000_000
    assert ned_from_body(pose)[2, 0] == pytest.approx(math.sin(0.2))  # nose down
    told = track_of(replace(flight_of(tmp_path / "a.mcap", {}), truth=()))
    assert told.pose_at(0.0).north_m == 9.0
    with pytest.raises(PicturesError, match="holds no poses"):
        track_of(replace(flight_of(tmp_path / "a.mcap", {}), truth=(), states=()))


def test_the_world_and_the_light_are_the_flights(tmp_path: Path) -> None:
    flight = flight_of(tmp_path / "a.mcap", {"world": "medium_voltage", "light": "overcast"})
    assert world_of(flight, None, None).light.direct == 0.0
    assert world_of(flight, None, "noon").light.direct > 0.5
    seen_live = flight_of(tmp_path / "a.mcap", {"camera": "sim:medium_voltage"})
    assert world_of(seen_live, None, None).name == "medium_voltage"
    with pytest.raises(PicturesError, match="give --world"):
        world_of(flight_of(tmp_path / "a.mcap", {}), None, None)
    with pytest.raises(PicturesError, match="light 'moonlight'"):
        world_of(flight_of(tmp_path / "a.mcap", {"world": "medium_voltage", "light": "moonlight"}), None, None)
    with pytest.raises(WorldError, match="atlantis"):
        world_of(flight_of(tmp_path / "a.mcap", {"world": "atlantis"}), None, None)


def test_replay_refuses_bad_input(tmp_path: Path) -> None:
    assert_refused(ran("replay", tmp_path / "none.mcap"), "cannot be read")
    (tmp_path / "x.mcap").write_bytes(b"no log at all")
    assert_refused(ran("replay", tmp_path / "x.mcap"), "is not an MCAP file")
    assert_refused(ran("replay", tmp_path / "x.mcap", "--out", tmp_path / "x.avi"), "ends in .mp4")


def test_another_number_of_pixels_keeps_the_rays() -> None:
    camera = scaled(pinhole(640, 480, 1.4), 320, 240)
    half = pinhole(320, 240, 1.4)
    assert (camera.fx_px, camera.cx_px, camera.cy_px) == pytest.approx((half.fx_px, half.cx_px, half.cy_px))
