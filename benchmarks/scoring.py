"""Scores of detected power lines against labelled photographs.

A set is a folder: `pld/*/NAME.jpg` with `NAME_lines.png` (pixels of power lines), `nadir/line_angle.csv` (file,
angle_deg_from_image_up_median) beside its images, `no_line/` and `no_tower/` (images without a power line).
"""

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.orientation import line_angle_distance_rad, mean_line_angle_rad
from vision.pipeline import LineFinder
from vision.records import Detection, Segments

TOLERANCE_SHARE = 0.0075  # a pixel is right within this share of the diagonal of a labelled one
ONE_DIRECTION_RAD = math.radians(5.0)


@dataclass(frozen=True, slots=True)
class PldScore:
    """What a finder makes of photographs with labelled pixels: shares, and angle errors [deg] of those with one way."""

    precision: float
    recall: float
    n_images: int
    present: float
    errors_deg: tuple[float, ...]

    @property
    def f_measure(self) -> float:
        """Harmonic mean of precision and recall."""
        total = self.precision + self.recall
        return 2 * self.precision * self.recall / total if total else 0.0

    @property
    def within_5_deg(self) -> float:
        """Share of the images with one direction whose angle is within 5 degrees of it."""
        return float(np.mean(np.array(self.errors_deg) <= 5.0))


def read_image(path: Path) -> NDArray[np.uint8]:
    """The image, (h, w, 3) BGR."""
    return np.asarray(cv2.imread(str(path)), dtype=np.uint8)


def labelled_images(folder: Path) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.uint8]]]:
    """Each photograph of a PLD folder and its labels, (h, w) uint8."""
    for path in sorted(folder.glob("*_lines.png")):
        labels = np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), dtype=np.uint8)
        yield read_image(path.with_name(path.name.replace("_lines.png", ".jpg"))), labels


def images_in(folder: Path) -> list[Path]:
    """The photographs of a folder, in order."""
    return sorted(path for path in folder.iterdir() if path.suffix.lower() in (".jpg", ".png"))


def tolerance_px(labels: NDArray[np.uint8]) -> float:
    """How far from a labelled pixel a pixel is still right."""
    return TOLERANCE_SHARE * math.hypot(*labels.shape)


def distance_px(pixels: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Distance of every pixel from the nearest one that is set."""
    return np.asarray(cv2.distanceTransform((pixels == 0).astype(np.uint8), cv2.DIST_L2, 5), dtype=np.float32)


def drawn(lines: Segments, shape: tuple[int, ...]) -> NDArray[np.uint8]:
    """Lines (n, 4) drawn one pixel wide."""
    canvas = np.zeros(shape, dtype=np.uint8)
    for x1, y1, x2, y2 in np.rint(lines).astype(int).tolist():
        cv2.line(canvas, (x1, y1), (x2, y2), 255, 1)
    return canvas


def precision_recall(lines: Segments, labels: NDArray[np.uint8]) -> tuple[float, float]:
    """Precision and recall of drawn `lines` (n, 4) against the labelled pixels, (h, w) uint8, not all 0."""
    canvas = drawn(lines, labels.shape)
    if not canvas.any():
        return 0.0, 0.0
    limit_px = tolerance_px(labels)
    return (
        float(np.mean(distance_px(labels)[canvas > 0] <= limit_px)),
        float(np.mean(distance_px(canvas)[labels > 0] <= limit_px)),
    )


def labelled_angle_rad(labels: NDArray[np.uint8]) -> float | None:
    """Direction of the labelled lines by their pixels' principal axes; None where they have no common one."""
    n_parts, parts = cv2.connectedComponents((labels > 0).astype(np.uint8))
    angles_rad, lengths_px = [], []
    for part in range(1, n_parts):
        y, x = np.nonzero(parts == part)
        if len(x) < 30:
            continue
        variances, axes = np.linalg.eigh(np.cov(x, y))
        if variances[1] < 25 * variances[0] + 50:
            continue
        angles_rad.append(math.atan2(axes[0, 1], -axes[1, 1]))
        lengths_px.append(math.sqrt(12 * variances[1]))
    if not angles_rad:
        return None
    angles, weights = np.array(angles_rad), np.array(lengths_px)
    mean_rad = mean_line_angle_rad(angles, weights)
    is_near = line_angle_distance_rad(angles, mean_rad) <= ONE_DIRECTION_RAD
    return mean_rad if weights[is_near].sum() > 0.9 * weights.sum() else None


def angle_error_deg(detection: Detection, truth_rad: float) -> float:
    """Distance of the found from the true line angle [deg]; 90 where none was found."""
    if detection.angle_rad is None:
        return 90.0
    return math.degrees(float(line_angle_distance_rad(np.array([detection.angle_rad]), truth_rad)[0]))


def score_pld(finder: LineFinder, folder: Path) -> PldScore:
    """Score one folder of photographs with labelled pixels."""
    scores, errors_deg, n_present = [], [], 0
    for image, labels in labelled_images(folder):
        detection = finder.find(image)
        scores.append(precision_recall(detection.power_lines, labels))
        n_present += detection.is_present
        truth_rad = labelled_angle_rad(labels)
        if truth_rad is not None:
            errors_deg.append(angle_error_deg(detection, truth_rad))
    precision, recall = np.mean(scores, axis=0).tolist()
    return PldScore(precision, recall, len(scores), n_present / len(scores), tuple(errors_deg))


def score_nadir(finder: LineFinder, table: Path) -> list[float]:
    """Angle errors [deg] on the photographs that `table` names."""
    with table.open(newline="") as file:
        return [
            angle_error_deg(
                finder.find(read_image((table.parent / row["file"]).with_suffix(".jpg"))),
                math.radians(float(row["angle_deg_from_image_up_median"])),
            )
            for row in csv.DictReader(file)
        ]


def false_presence(finder: LineFinder, folder: Path) -> float:
    """Share of the images of `folder`, none of which shows a line, where the finder says that one does."""
    return float(np.mean([finder.find(read_image(path)).is_present for path in images_in(folder)]))


def count_lines(finder: LineFinder, folder: Path) -> tuple[int, int, int]:
    """True and false lines, and labelled conductors that were missed ([Ceron] table 3.2), over a folder.

    Counted are all lines that the detector gives before any is chosen. One is true when 80 % of its pixels are right, a
    labelled part is found when half of its pixels lie on a line.
    """
    n_true, n_false, n_missed = 0, 0, 0
    for image, labels in labelled_images(folder):
        segments = finder.find(image).segments
        limit_px, to_label = tolerance_px(labels), distance_px(labels)
        for segment in segments:
            canvas = drawn(segment[None], labels.shape)
            is_true = canvas.any() and np.mean(to_label[canvas > 0] <= limit_px) >= 0.8
            n_true, n_false = n_true + bool(is_true), n_false + (not is_true)
        is_found = distance_px(drawn(segments, labels.shape)) <= limit_px
        n_parts, parts = cv2.connectedComponents((labels > 0).astype(np.uint8))
        sizes = [is_found[parts == part] for part in range(1, n_parts)]
        n_missed += sum(float(part.mean()) < 0.5 for part in sizes if part.size >= 30)
    return n_true, n_false, n_missed
