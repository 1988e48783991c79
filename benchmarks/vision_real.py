"""Scores of the line finder on folders of real photographs: `python benchmarks/vision_real.py --data FOLDER`.

FOLDER holds `pld/*/NAME.jpg` with `NAME_lines.png` (pixels of power lines), `nadir/line_angle.csv` (file,
angle_deg_from_image_up_median) beside its images, and `no_line/` (images without a power line); what is missing is
left out.
"""

import argparse
import csv
import math
import time
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.orientation import line_angle_distance_rad, mean_line_angle_rad
from vision.pipeline import LineFinder, VisionSettings
from vision.records import Detection, Segments

TOLERANCE_SHARE = 0.0075  # a pixel is right within this share of the diagonal of a labelled one
ONE_DIRECTION_RAD = math.radians(5.0)


def find_timed(finder: LineFinder, path: Path, times_ms: list[float]) -> Detection:
    """Run the finder on a photograph; adds its time [ms] to `times_ms`."""
    image = np.asarray(cv2.imread(str(path)), dtype=np.uint8)
    start = time.perf_counter()
    detection = finder.find(image)
    times_ms.append(1e3 * (time.perf_counter() - start))
    return detection


def precision_recall(lines: Segments, labels: NDArray[np.uint8]) -> tuple[float, float]:
    """Precision and recall of drawn `lines` (n, 4) against the labelled pixels, (h, w) uint8, not all 0."""
    drawn = np.zeros_like(labels)
    for x1, y1, x2, y2 in np.rint(lines).astype(int).tolist():
        cv2.line(drawn, (x1, y1), (x2, y2), 255, 1)
    if not drawn.any():
        return 0.0, 0.0
    tolerance_px = TOLERANCE_SHARE * math.hypot(*labels.shape)
    to_label = cv2.distanceTransform((labels == 0).astype(np.uint8), cv2.DIST_L2, 5)
    to_drawn = cv2.distanceTransform((drawn == 0).astype(np.uint8), cv2.DIST_L2, 5)
    return float(np.mean(to_label[drawn > 0] <= tolerance_px)), float(np.mean(to_drawn[labels > 0] <= tolerance_px))


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


def score_pld(finder: LineFinder, folder: Path) -> None:
    """Print what the finder makes of one folder of photographs with labelled pixels."""
    scores, errors_deg, times_ms, n_present = [], [], list[float](), 0
    for path in sorted(folder.glob("*_lines.png")):
        labels = np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), dtype=np.uint8)
        detection = find_timed(finder, path.with_name(path.name.replace("_lines.png", ".jpg")), times_ms)
        scores.append(precision_recall(detection.power_lines, labels))
        n_present += detection.is_present
        truth_rad = labelled_angle_rad(labels)
        if truth_rad is not None:
            errors_deg.append(angle_error_deg(detection, truth_rad))
    precision, recall = np.mean(scores, axis=0)
    print(
        f"{folder.name}: {len(scores)} images, precision {precision:.3f}, recall {recall:.3f}, "
        f"F {2 * precision * recall / (precision + recall):.3f}; present {n_present / len(scores):.3f}; "
        f"angle of {len(errors_deg)} with one direction: median error {np.median(errors_deg):.2f} deg, "
        f"within 5 deg {np.mean(np.array(errors_deg) <= 5):.3f}; {np.median(times_ms):.1f} ms"
    )


def score_nadir(finder: LineFinder, table: Path) -> None:
    """Print the angle errors on the photographs that `table` names."""
    times_ms, errors_deg = list[float](), []
    with table.open(newline="") as file:
        for row in csv.DictReader(file):
            detection = find_timed(finder, (table.parent / row["file"]).with_suffix(".jpg"), times_ms)
            errors_deg.append(angle_error_deg(detection, math.radians(float(row["angle_deg_from_image_up_median"]))))
            print(f"nadir {row['file']}: error {errors_deg[-1]:.2f} deg, {detection.n_lines} lines")
    print(f"nadir: median error {np.median(errors_deg):.2f} deg; {np.median(times_ms):.1f} ms")


def score_no_line(finder: LineFinder, folder: Path) -> None:
    """Print how often the finder sees a line where there is none."""
    times_ms: list[float] = []
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in (".jpg", ".png"))
    false_alarms = [path.name for path in paths if find_timed(finder, path, times_ms).is_present]
    print(f"{folder.name}: {len(paths)} images, present {len(false_alarms) / len(paths):.3f}")


def main() -> None:
    """Score every set that the folder holds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder that holds the sets")
    folder = parser.parse_args().data
    cv2.setNumThreads(1)
    finder = LineFinder(VisionSettings())
    finder.warm_up()
    for pld in sorted(path for path in folder.glob("pld/*") if path.is_dir()):
        score_pld(finder, pld)
    if (folder / "nadir" / "line_angle.csv").is_file():
        score_nadir(finder, folder / "nadir" / "line_angle.csv")
    for empty in ("no_line", "no_tower"):
        if (folder / empty).is_dir():
            score_no_line(finder, folder / empty)


if __name__ == "__main__":
    main()
