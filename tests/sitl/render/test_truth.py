"""The truth lies where the picture shows it, hidden things are hidden, and the label files say the same."""

import dataclasses
import functools
import math

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.camera.camera import Intrinsics
from sitl.control import quaternion_of
from sitl.pose import Pose
from sitl.render.lens import DOWN, FRONT, CameraMount, lens_vector, pinhole
from sitl.render.renderer import Renderer
from sitl.render.sensor import Optics
from sitl.render.truth.coco import coco_annotations, coco_categories, coco_image, run_lengths
from sitl.render.truth.strips import find_strips, mark_strips
from sitl.render.truth.truth import CATEGORIES, NOTHING, MaskValue, Truth, TruthFinder
from sitl.render.truth.yolo import yolo_boxes, yolo_polygons
from sitl.world.file import load_world
from sitl.world.records import Conductor, Member, Support, World

CAMERA = pinhole(320, 240, math.radians(80.0))
BENT = dataclasses.replace(CAMERA, distortion=(-0.22, 0.06, 0.001, -0.0005, 0.0))
FLAWLESS = Optics(blur_px=0.0, corner_light=1.0, read_noise=0.0, shot_noise=0.0)
OVER_A_POLE = Pose(0, 14.0, -3.5, -14.0, quaternion_of(0.05, -0.1, math.radians(110.0)))


def world_of(wires: tuple[Conductor, ...], supports: tuple[Support, ...] = ()) -> World:
    world = load_world()
    return dataclasses.replace(world, lines=(dataclasses.replace(world.line, supports=supports, conductors=wires),))


def wire(east_m: float, height_m: float, diameter_m: float = 0.01, *, is_shield: bool = False) -> Conductor:
    return Conductor(diameter_m, np.array([[-40.0, east_m, -height_m], [40.0, east_m, -height_m]]), is_shield)


def pole(north_m: float, east_m: float, height_m: float) -> Support:
    foot, top = (north_m, east_m, 0.0), (north_m, east_m, -height_m)
    return Support("wood_pole", foot, top, 0.0, (Member(foot, top, 0.3, 0.2, "wood"),))


def truth_of(world: World, pose: Pose, camera: Intrinsics = CAMERA, mount: CameraMount = DOWN) -> Truth:
    return TruthFinder(Renderer(world, camera, mount)).find(pose)


@functools.cache
def over_a_pole() -> Truth:
    return truth_of(load_world(), OVER_A_POLE)


LEVEL = Pose(0, 0.0, 0.0, -16.0, quaternion_of(0.0, 0.0, 0.0))


def test_a_wire_thinner_than_a_pixel_is_marked_all_along() -> None:
    truth = truth_of(world_of((wire(1.0, 10.0),)), Pose(0, 0.0, 0.0, -16.0, quaternion_of(0.0, 0.0, 0.4)))
    assert CAMERA.fx_px * 0.01 / 6.0 < 0.5
    rows = np.flatnonzero((truth.mask == MaskValue.CONDUCTOR).any(axis=1))
    assert len(rows) == 240  # it crosses the whole picture
    assert set((truth.mask == MaskValue.CONDUCTOR).sum(axis=1)) <= {1, 2}
    n_parts, _ = cv2.connectedComponents((truth.mask > 0).astype(np.uint8), connectivity=8)
    assert n_parts == 2  # one, and the background
    assert truth.depth_m[truth.mask == MaskValue.CONDUCTOR] == pytest.approx(6.0, rel=1e-3)
    beside = cv2.dilate(truth.mask, np.ones((3, 3), np.uint8)) == MaskValue.NOTHING
    assert truth.depth_m[beside] == pytest.approx(16.0, rel=1e-3)


def test_a_wire_too_thin_to_be_seen_is_not_marked() -> None:
    assert CAMERA.fx_px * 0.0012 / 6.0 < 0.05
    assert not truth_of(world_of((wire(1.0, 10.0, 0.0012),)), LEVEL).mask.any()


def test_a_thick_wire_is_marked_as_wide_as_it_is() -> None:
    truth = truth_of(world_of((wire(0.0, 10.0, 0.3),)), LEVEL)
    width_px = CAMERA.fx_px * 0.3 / 6.0
    assert (truth.mask == MaskValue.CONDUCTOR).sum(axis=1) == pytest.approx(width_px, abs=1.0)


@pytest.mark.parametrize("camera", [CAMERA, BENT], ids=["pinhole", "bent"])
@pytest.mark.parametrize("mount", [DOWN, FRONT], ids=["down", "front"])
def test_the_mask_lies_where_the_picture_shows_something(camera: Intrinsics, mount: CameraMount) -> None:
    """What the line changes in the picture of the empty ground is marked, but for its shadow."""
    scene = load_world()
    empty = dataclasses.replace(scene, lines=(dataclasses.replace(scene.line, supports=(), conductors=()),))
    renderer = Renderer(scene, camera, mount, FLAWLESS)
    lit = renderer.light(OVER_A_POLE).copy()
    changed = np.abs(lit - Renderer(empty, camera, mount, FLAWLESS).light(OVER_A_POLE)).max(axis=2)
    truth = TruthFinder(renderer).find(OVER_A_POLE)
    near = cv2.dilate((truth.mask > 0).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    assert (truth.mask > 0).sum() > 400
    assert np.median(changed[truth.mask > 0]) > 10.0 * np.median(changed[~near])
    shifted = np.roll(truth.mask, (9, 13), axis=(0, 1)) > 0
    assert changed[truth.mask > 0].mean() > 4.0 * changed[shifted & ~near].mean()


def test_conductors_shield_wires_and_supports_are_told_apart() -> None:
    world = world_of((wire(-2.0, 9.0), wire(2.0, 9.5, is_shield=True)), (pole(3.0, 0.0, 9.0),))
    truth = truth_of(world, LEVEL)
    assert set(np.unique(truth.mask)) == {0, 1, 2, 3}
    assert truth.mask[200, round(159.5 - 2.0 * CAMERA.fx_px / 7.0)] == MaskValue.CONDUCTOR
    assert truth.mask[200, round(159.5 + 2.0 * CAMERA.fx_px / 6.5)] == MaskValue.SHIELD_WIRE
    assert [box.category for box in truth.boxes] == ["conductor", "shield_wire", "wood_pole"]
    assert [line.is_shield for line in truth.lines] == [False, True]


def test_what_stands_before_a_wire_hides_it() -> None:
    """The upper wire hides the lower one where they cross; a thick pole hides what runs behind it."""
    upper, lower = wire(0.0, 12.0, 0.4), Conductor(0.01, np.array([[0.0, -40.0, -8.0], [0.0, 40.0, -8.0]]))
    for wires in ((upper, lower), (lower, upper)):
        truth = truth_of(world_of(wires), LEVEL)
        thing = wires.index(upper)
        assert truth.numbers[119, 150:170].tolist().count(thing) > 15
        line = next(line for line in truth.lines if line.thing != thing)
        assert 0.85 < line.pieces[0, 4] < 1.0
    ground = dataclasses.replace(LEVEL, down_m=-6.0)
    assert (truth_of(world_of((lower,)), ground).mask == 0).all()


def test_what_the_scene_hides_is_not_marked() -> None:
    world = world_of((wire(1.0, 10.0),))

    class BehindAWall(Renderer):
        def depth(self, pose: Pose) -> NDArray[np.float32]:
            depth_m = super().depth(pose)
            depth_m[:100] = 3.0
            return depth_m

    truth = TruthFinder(BehindAWall(world, CAMERA)).find(LEVEL)
    assert not truth.mask[:100].any()
    assert truth.mask[100:].any(axis=1).all()
    (line,) = truth.lines
    assert line.pieces[:, 4].mean() == pytest.approx(140 / 240, abs=0.02)
    assert truth.boxes[0].top == 100


def test_boxes_are_tight_around_what_is_visible() -> None:
    truth = over_a_pole()
    assert {box.category for box in truth.boxes} == {"conductor", "concrete_pole"}
    for box in truth.boxes:
        own = truth.numbers == box.thing
        rows, columns = np.flatnonzero(own.any(axis=1)), np.flatnonzero(own.any(axis=0))
        assert (box.top, box.bottom) == (rows[0], rows[-1] + 1)
        assert (box.left, box.right) == (columns[0], columns[-1] + 1)


def test_coco_entries_hold_the_pixels_themselves() -> None:
    truth = over_a_pole()
    assert coco_image(7, "a.png", truth) == {"id": 7, "file_name": "a.png", "width": 320, "height": 240}
    names = {entry["id"]: entry["name"] for entry in coco_categories()}
    assert tuple(names.values()) == CATEGORIES
    entries = coco_annotations(7, 100, truth)
    assert [entry["id"] for entry in entries] == list(range(100, 100 + len(truth.boxes)))
    for entry, box in zip(entries, truth.boxes, strict=True):
        assert names[entry["category_id"]] == box.category
        size, counts = entry["segmentation"]["size"], entry["segmentation"]["counts"]
        assert sum(counts) == size[0] * size[1]
        flat = np.repeat(np.arange(len(counts)) % 2, counts).astype(bool)
        np.testing.assert_array_equal(flat.reshape(size, order="F"), truth.numbers == box.thing)
        assert entry["area"] == flat.sum()


def test_run_lengths_begin_with_what_is_not_in_it() -> None:
    assert run_lengths(np.array([[True, False], [True, True]])) == [0, 2, 1, 1]
    assert run_lengths(np.array([[False, False], [True, False]])) == [1, 1, 2]


def test_yolo_lines_say_the_same_in_parts_of_the_picture() -> None:
    truth = over_a_pole()
    lines = yolo_boxes(truth).splitlines()
    assert len(lines) == len(truth.boxes)
    for line, box in zip(lines, truth.boxes, strict=True):
        category, x, y, width, height = map(float, line.split())
        assert CATEGORIES[int(category)] == box.category
        assert (x - width / 2) * 320 == pytest.approx(box.left, abs=1e-3)
        assert (y + height / 2) * 240 == pytest.approx(box.bottom, abs=1e-3)
    painted = np.zeros((240, 320), dtype=np.uint8)
    for line in yolo_polygons(truth).splitlines():
        category, *numbers = map(float, line.split())
        assert CATEGORIES[int(category)] == "conductor"
        outline = np.array(numbers).reshape(-1, 2)
        assert outline.min() >= 0.0
        assert outline.max() <= 1.0
        cv2.fillPoly(painted, [np.round(outline * [320, 240] - 0.5).astype(np.int32)], 1)
    marked = truth.mask == MaskValue.CONDUCTOR
    assert (painted[marked] > 0).mean() > 0.9
    assert cv2.dilate(marked.astype(np.uint8), np.ones((5, 5)))[painted > 0].all()


def test_compiled_kernels_equal_plain_python() -> None:
    rng = np.random.default_rng(3)
    members = np.hstack([rng.uniform(-6, 6, (30, 2)), rng.uniform(-9, 0, (30, 1)), rng.uniform(-6, 6, (30, 2)),
                         rng.uniform(-9, 0, (30, 1)), rng.uniform(0.01, 0.4, (30, 2))])  # fmt: skip
    centre, camera_from_ned = np.array([0.0, 0.0, -8.0]), np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    view, thing = np.array([-0.8, 0.8, -0.6, 0.6]), np.arange(30, dtype=np.int32) // 2
    for camera in (pinhole(64, 48, 1.4), dataclasses.replace(pinhole(64, 48, 1.4), distortion=(-0.1, 0, 0, 0, 0))):
        results = []
        for find, mark in ((find_strips, mark_strips), (find_strips.py_func, mark_strips.py_func)):
            strips = find(members, centre, camera_from_ned, lens_vector(camera), view)
            numbers, depth_m = np.full((48, 64), NOTHING, dtype=np.int32), np.full((48, 64), 9.0, dtype=np.float32)
            mark(numbers, depth_m, strips, thing)
            results.append((strips, numbers, depth_m))
        np.testing.assert_allclose(results[0][0], results[1][0], rtol=1e-9)
        np.testing.assert_array_equal(results[0][1], results[1][1])
        np.testing.assert_allclose(results[0][2], results[1][2], rtol=1e-6)
        assert len(np.unique(results[0][1])) > 5
