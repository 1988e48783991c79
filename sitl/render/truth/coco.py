"""Labels in the form of COCO: one file for all pictures (https://cocodataset.org/#format-data)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl.render.truth.truth import CATEGORIES, Truth


def coco_categories() -> list[dict[str, Any]]:
    """The categories' entries."""
    return [{"id": number, "name": name, "supercategory": "power_line"} for number, name in enumerate(CATEGORIES, 1)]


def coco_image(image_id: int, file_name: str, truth: Truth) -> dict[str, Any]:
    """The entry of one picture."""
    height_px, width_px = truth.mask.shape
    return {"id": image_id, "file_name": file_name, "width": width_px, "height": height_px}


def coco_annotations(image_id: int, first_id: int, truth: Truth) -> list[dict[str, Any]]:
    """The entries of everything in one picture, numbered from `first_id`.

    A conductor is one thing over all its spans. Segmentations are uncompressed run lengths, because wires are thin
    and cut by what stands before them.
    """
    entries = []
    for number, box in enumerate(truth.boxes, first_id):
        own = truth.numbers == box.thing
        entries.append(
            {
                "id": number,
                "image_id": image_id,
                "category_id": CATEGORIES.index(box.category) + 1,
                "bbox": [box.left, box.top, box.right - box.left, box.bottom - box.top],
                "area": int(own.sum()),
                "iscrowd": 0,
                "segmentation": {"size": list(own.shape), "counts": run_lengths(own)},
            }
        )
    return entries


def run_lengths(is_own: NDArray[np.bool_]) -> list[int]:
    """COCO's run lengths: down the columns one after the other, what is not in it first."""
    flat = is_own.ravel(order="F")
    edges = np.flatnonzero(np.diff(flat)) + 1
    counts = np.diff(np.concatenate([[0], edges, [len(flat)]])).tolist()
    return [0, *counts] if flat[0] else counts
