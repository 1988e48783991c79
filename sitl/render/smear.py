"""The ground while the camera moves, from one picture of it: every pixel gathers along the way that its point went."""

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from drivers.camera.camera import Intrinsics
from sitl.render.lens import CameraMount, camera_pose, lens_vector
from sitl.render.motion import Motion, Shutter, sub_times_s
from sitl.render.projection import NEAR_M, project_point

BLOCK_PX = 16
_FAR_M = 1e5


def grid_places(n_px: int) -> NDArray[np.int64]:
    """The rows, or columns, that the flow is worked out at: every sixteenth and the last."""
    return np.unique(np.append(np.arange(0, n_px, BLOCK_PX), n_px - 1))


def find_flow(
    motion: Motion,
    shutter: Shutter,
    exposure_s: float,
    mount: CameraMount,
    intrinsics: Intrinsics,
    rays: NDArray[np.float32],
    depth_m: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Where in the picture of `motion.pose` stands what each pixel sees at its exposure's start and end.

    `rays` is lens.ray_table's and `depth_m` (rows, columns) the ground's [m] at grid_places(), seen from `motion.pose`.
    Returns (2, rows, columns, 2) float32 [px]: start and end, there, x and y as a shift from the pixel itself.
    """
    rows, columns = grid_places(intrinsics.height_px), grid_places(intrinsics.width_px)
    z = np.minimum(depth_m, _FAR_M).astype(np.float64)
    x, y = rays[:, rows[:, None], columns[None, :]].astype(np.float64)
    points = np.stack([x * z, y * z, z], axis=-1)
    centre, ned_from_camera = camera_pose(motion.pose, mount)
    lens = lens_vector(intrinsics)
    flow = np.empty((2, len(rows), len(columns), 2), dtype=np.float32)
    for i, row in enumerate(rows):
        for end in range(2):
            dt_s = shutter.row_s(float(row), intrinsics.height_px) + exposure_s * (end - 0.5)
            then, ned_from_then = camera_pose(motion.pose_at(dt_s), mount)
            seen = ((points[i] @ ned_from_then.T) + then - centre) @ ned_from_camera
            _shift(seen, rows[i], columns, lens, flow[end, i])
    return flow


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def _shift(
    points: NDArray[np.float64],
    row: int,
    columns: NDArray[np.int64],
    lens: NDArray[np.float64],
    out: NDArray[np.float32],
) -> None:
    """Write how far [px] from their pixels camera-frame points (n, 3) [m] are projected."""
    for j in range(len(points)):
        u, v = project_point(points[j, 0], points[j, 1], max(NEAR_M, points[j, 2]), lens)
        out[j, 0] = u - columns[j]
        out[j, 1] = v - row


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def spread_flow(
    flow: NDArray[np.float32],
    part: float,
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    map_x: NDArray[np.float32],
    map_y: NDArray[np.float32],
) -> None:
    """Write where each pixel looks at a part of its exposure, from 0 at the start to 1 at the end: maps for cv2.remap.

    `flow` is find_flow()'s, `rows` and `columns` are grid_places(); the maps are (height, width) float32.
    """
    upper, late = np.empty((len(columns), 2), dtype=np.float32), np.float32(part)
    for i in range(len(rows) - 1):
        for v in range(rows[i], rows[i + 1] + 1):
            fv = np.float32((v - rows[i]) / (rows[i + 1] - rows[i]))
            for j in range(len(columns)):
                for axis in range(2):
                    above = flow[0, i, j, axis] + late * (flow[1, i, j, axis] - flow[0, i, j, axis])
                    below = flow[0, i + 1, j, axis] + late * (flow[1, i + 1, j, axis] - flow[0, i + 1, j, axis])
                    upper[j, axis] = above + fv * (below - above)
            for j in range(len(columns) - 1):
                first, n = columns[j], columns[j + 1] - columns[j] + 1
                step = np.float32(1.0 / (n - 1))
                x, dx = np.float32(first) + upper[j, 0], np.float32(1.0) + step * (upper[j + 1, 0] - upper[j, 0])
                y, dy = np.float32(v) + upper[j, 1], step * (upper[j + 1, 1] - upper[j, 1])
                row_x, row_y = map_x[v, first : first + n], map_y[v, first : first + n]
                for k in range(n):
                    row_x[k] = x + np.float32(k) * dx
                    row_y[k] = y + np.float32(k) * dy


def smear(light: NDArray[np.float32], flow: NDArray[np.float32], n_samples: int) -> NDArray[np.float32]:
    """Gather `light` (height, width, 3) along find_flow()'s way, in `n_samples` even steps; a new array.

    Beyond the picture its border goes on.
    """
    rows, columns = grid_places(light.shape[0]), grid_places(light.shape[1])
    map_x, map_y = np.empty((2, *light.shape[:2]), dtype=np.float32)
    gathered = np.zeros_like(light)
    for part in sub_times_s(1.0, n_samples):
        spread_flow(flow, 0.5 + part, rows, columns, map_x, map_y)
        seen = cv2.remap(light, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        cv2.accumulate(seen, gathered)
    gathered *= np.float32(1.0 / n_samples)
    return gathered
