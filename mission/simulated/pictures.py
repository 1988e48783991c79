"""Pictures of simulated worlds with their truth: one of a pose, or many along the line as a data set."""

import csv
import json
import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.camera.camera import Intrinsics
from sitl.control import quaternion_of
from sitl.pose import Pose
from sitl.render.lens import DOWN, FRONT, CameraMount, pinhole
from sitl.render.motion import Motion
from sitl.render.photographer import Photographer
from sitl.render.renderer import Renderer
from sitl.render.truth.coco import coco_annotations, coco_categories, coco_image
from sitl.render.truth.files import boxes_entry, depth_millimetres, lines_entry, png
from sitl.render.truth.sampling import CameraName, View, sample_view
from sitl.render.truth.truth import CATEGORIES, Truth, TruthFinder
from sitl.render.truth.yolo import yolo_boxes, yolo_polygons
from sitl.world.file import load_world
from sitl.world.light import LIGHT_NAMES, LightName
from sitl.world.records import World
from sitl.world.surface import surface_of

LabelFormat = Literal["coco", "yolo", "both"]
MOUNTS: dict[CameraName, CameraMount] = {"down": DOWN, "front": FRONT}
_CHUNK = 8
_JPEG_QUALITY = 95


class PicturesError(Exception):
    """A picture could not be taken or kept; the message is one sentence."""


@dataclass(frozen=True, slots=True)
class DatasetSettings:
    """What a data set is made of. `light` None is each world's own, "random" any of the lights for each picture."""

    world: str
    out: Path
    n: int
    seed: int
    cameras: tuple[CameraName, ...]
    light: LightName | Literal["random"] | None
    labels: LabelFormat
    width_px: int
    height_px: int
    hfov_rad: float
    is_jpeg: bool


def render_picture(
    world: str, light: LightName | None, pose_deg: Sequence[float], camera: CameraName, intrinsics: Intrinsics
) -> tuple[NDArray[np.uint8], Truth]:
    """A picture and its truth, from north, east, down [m], yaw, pitch and roll [degrees]; raises WorldError."""
    scene = load_world(world, light)
    north_m, east_m, down_m = pose_deg[:3]
    yaw_rad, pitch_rad, roll_rad = map(math.radians, pose_deg[3:6])
    over_m = -down_m - surface_of(scene).at(north_m, east_m)
    if over_m < 0.05:
        raise PicturesError(
            f"The pose is {-over_m:.2f} m below what stands at {north_m:g} m north, {east_m:g} m east; down counts "
            "downwards, so that 16 m over the start is -16."
        )
    renderer = Renderer(scene, intrinsics, MOUNTS[camera])
    pose = Pose(0, north_m, east_m, down_m, quaternion_of(roll_rad, pitch_rad, yaw_rad))
    shot = Photographer(renderer).take_alone(Motion(pose), 0)
    return shot.image, TruthFinder(renderer).find(pose)


def write_picture_files(out: Path, image: NDArray[np.uint8], truth: Truth | None) -> list[Path]:
    """Write the picture as `out`, and its truth, where there is one, beside it; raises PicturesError."""
    contents: dict[Path, bytes] = {out: png(image)}
    if truth is not None:
        stem = out.with_suffix("")
        contents |= {
            Path(f"{stem}_mask.png"): png(truth.mask),
            Path(f"{stem}_depth.png"): png(depth_millimetres(truth.depth_m)),
            Path(f"{stem}_lines.json"): json.dumps(lines_entry(truth)).encode(),
            Path(f"{stem}_boxes.json"): json.dumps(boxes_entry(truth)).encode(),
        }
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        for file, content in contents.items():
            file.write_bytes(content)
    except OSError as error:
        raise PicturesError(f"The picture {out} cannot be written: {error.strerror}.") from error
    return list(contents)


def make_dataset(settings: DatasetSettings, on_picture: Callable[[], None]) -> None:
    """Render a data set with one process for each core; the same settings make the same files.

    `on_picture` is called for each one that is done. Raises WorldError, and PicturesError when the folder is not empty
    or cannot be written.
    """
    load_world(settings.world)
    folders = ["images", "masks", "depth", *(["labels", "labels_polygons"] if settings.labels != "coco" else [])]
    try:
        settings.out.mkdir(parents=True, exist_ok=True)
        if any(settings.out.iterdir()):
            raise PicturesError(f"The folder {settings.out} is not empty; name a new one for the data set.")
        for folder in folders:
            (settings.out / folder).mkdir()
        entries = _take_all(settings, on_picture)
        _write_indexes(settings, entries)
    except OSError as error:
        raise PicturesError(f"The data set {settings.out} cannot be written: {error.strerror}.") from error


@dataclass(frozen=True, slots=True)
class _Entry:
    """What the indexes say of one picture."""

    row: dict[str, Any]
    image: dict[str, Any]
    annotations: list[dict[str, Any]]


def _take_all(settings: DatasetSettings, on_picture: Callable[[], None]) -> list[_Entry]:
    # Pictures of the same light and camera stand together: each pair needs its own renderer, which takes seconds.
    order = sorted(
        range(settings.n), key=lambda index: (_choose(settings, index)[1] or "", _choose(settings, index)[0])
    )
    chunks = [order[first : first + _CHUNK] for first in range(0, settings.n, _CHUNK)]
    entries: dict[int, _Entry] = {}
    n_workers = max(1, min(len(chunks), len(os.sched_getaffinity(0))))
    with ProcessPoolExecutor(n_workers, get_context("spawn"), _start_worker, (settings,)) as pool:
        pending = [(chunk, pool.submit(_take_chunk, chunk)) for chunk in chunks]
        try:
            for chunk, future in pending:
                for index, entry in zip(chunk, future.result(), strict=True):
                    entries[index] = entry
                    on_picture()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return [entries[index] for index in range(settings.n)]


def _choose(settings: DatasetSettings, index: int) -> tuple[CameraName, LightName | None]:
    """The camera and the light of a picture."""
    rng = np.random.default_rng((settings.seed, index, 1))
    camera = settings.cameras[index % len(settings.cameras)]
    if settings.light == "random":
        return camera, LIGHT_NAMES[int(rng.integers(len(LIGHT_NAMES)))]
    return camera, settings.light


class _Worker:
    """Takes pictures in one process; keeps the renderer of the last light and camera."""

    def __init__(self, settings: DatasetSettings) -> None:
        self.settings = settings
        self._key: tuple[CameraName, LightName | None] | None = None

    def take(self, index: int) -> _Entry:
        """Take picture number `index`, and write its files."""
        settings, key = self.settings, _choose(self.settings, index)
        if key != self._key:
            camera, light = self._key = key
            self._world: World = load_world(settings.world, light)
            self._surface = surface_of(self._world)
            intrinsics = pinhole(settings.width_px, settings.height_px, settings.hfov_rad)
            renderer = Renderer(self._world, intrinsics, MOUNTS[camera], seed=settings.seed)
            self._photographer = Photographer(renderer)
            self._truth = TruthFinder(renderer)
        camera, light = key
        view = sample_view(self._world, self._surface, camera, np.random.default_rng((settings.seed, index)))
        shot = self._photographer.take_alone(view.motion, index)
        truth = self._truth.find(view.motion.pose)
        name = f"{index:06d}"
        file_name = f"{name}.jpg" if settings.is_jpeg else f"{name}.png"
        self._write(name, file_name, shot.image, truth)
        row = _row(file_name, camera, light, view) | {"exposure_s": shot.exposure.time_s, "gain": shot.exposure.gain}
        annotations = coco_annotations(index + 1, 1, truth) if settings.labels != "yolo" else []
        return _Entry(row, coco_image(index + 1, file_name, truth), annotations)

    def _write(self, name: str, file_name: str, image: NDArray[np.uint8], truth: Truth) -> None:
        out = self.settings.out
        picture = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1].tobytes()
        (out / "images" / file_name).write_bytes(picture if self.settings.is_jpeg else png(image))
        (out / "masks" / f"{name}.png").write_bytes(png(truth.mask))
        (out / "depth" / f"{name}.png").write_bytes(png(depth_millimetres(truth.depth_m)))
        if self.settings.labels != "coco":
            (out / "labels" / f"{name}.txt").write_text(yolo_boxes(truth), encoding="ascii")
            (out / "labels_polygons" / f"{name}.txt").write_text(yolo_polygons(truth), encoding="ascii")


_worker: _Worker | None = None  # a pool's process has one


def _start_worker(settings: DatasetSettings) -> None:
    global _worker
    cv2.setNumThreads(1)  # the processes share the cores out already
    _worker = _Worker(settings)


def _take_chunk(indices: list[int]) -> list[_Entry]:
    if _worker is None:
        raise RuntimeError("a process without a worker")
    return [_worker.take(index) for index in indices]


def _row(file_name: str, camera: CameraName, light: LightName | None, view: View) -> dict[str, Any]:
    pose = view.motion.pose
    row: dict[str, Any] = {"file": file_name, "camera": camera, "light": light or ""}
    row |= {"north_m": pose.north_m, "east_m": pose.east_m, "down_m": pose.down_m}
    row |= {"yaw_deg": math.degrees(view.yaw_rad), "pitch_deg": math.degrees(view.pitch_rad)}
    row |= {"roll_deg": math.degrees(view.roll_rad)}
    row |= dict(zip(("qw", "qx", "qy", "qz"), pose.quaternion, strict=True))
    return row | dict(zip(("v_north_m_s", "v_east_m_s", "v_down_m_s"), view.motion.velocity_ned_m_s, strict=True))


def _write_indexes(settings: DatasetSettings, entries: list[_Entry]) -> None:
    camera = pinhole(settings.width_px, settings.height_px, settings.hfov_rad)
    lens = {"fx_px": camera.fx_px, "fy_px": camera.fy_px, "cx_px": camera.cx_px, "cy_px": camera.cy_px}
    with (settings.out / "poses.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [*entries[0].row, *lens], lineterminator="\n")
        writer.writeheader()
        for entry in entries:
            row = {key: f"{value:.9g}" if isinstance(value, float) else value for key, value in entry.row.items()}
            writer.writerow(row | {key: f"{value:.9g}" for key, value in lens.items()})
    if settings.labels != "yolo":
        annotations = [annotation for entry in entries for annotation in entry.annotations]
        index = {
            "info": {"description": f"Power lines of the simulated world {settings.world}, seed {settings.seed}"},
            "images": [entry.image for entry in entries],
            "annotations": [annotation | {"id": number} for number, annotation in enumerate(annotations, 1)],
            "categories": coco_categories(),
        }
        (settings.out / "instances.json").write_text(json.dumps(index), encoding="utf-8")
    if settings.labels != "coco":
        names = "".join(f"  {number}: {name}\n" for number, name in enumerate(CATEGORIES))
        text = f"path: .\ntrain: images\nval: images\nnames:\n{names}"
        (settings.out / "data.yaml").write_text(text, encoding="utf-8")


def picture_camera(width_px: int, height_px: int, hfov_deg: float) -> Intrinsics:
    """The undistorted camera of a picture."""
    return pinhole(width_px, height_px, math.radians(hfov_deg))


def scaled(camera: Intrinsics, width_px: int, height_px: int) -> Intrinsics:
    """The same lens with another number of pixels."""
    sx, sy = width_px / camera.width_px, height_px / camera.height_px
    return replace(
        camera,
        width_px=width_px,
        height_px=height_px,
        fx_px=sx * camera.fx_px,
        fy_px=sy * camera.fy_px,
        cx_px=sx * (camera.cx_px + 0.5) - 0.5,
        cy_px=sy * (camera.cy_px + 0.5) - 0.5,
    )
