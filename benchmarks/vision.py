"""Compare the detectors side by side, in one run and on one thread, and write what came out to docs/benchmarks.md.

    python -m benchmarks.vision [--data FOLDER] [--repeats N] [--out FILE]

FOLDER holds labelled photographs (benchmarks/scoring.py says how); without it only the drawn images are measured.
"""

import argparse
import itertools
import math
import statistics
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks import scoring
from benchmarks.page import PAGE, table, write_section
from benchmarks.worker import worker_text
from vision.edges import find_edges, to_grey
from vision.orientation import line_angle_distance_rad, segment_angles_rad
from vision.pipeline import Detector, LineFinder, VisionSettings

DETECTORS: tuple[Detector, ...] = ("projection", "cbs", "steerable", "hough", "lsd", "edlines")
WIDTHS_PX = (333, 640, 800, 1280)
MEGAPIXELS = (0.3, 1.0, 2.0, 4.0, 8.0)
N_PHOTOGRAPHS = 8

Image = NDArray[np.uint8]


def radial_pattern(size_px: int = 333) -> Image:
    """Lines through the middle every pi / 16, dark on white ([Ceron] 3.4.1, figure 3.15)."""
    canvas = np.full((size_px, size_px), 255, dtype=np.uint8)
    middle = (size_px - 1) / 2
    for step in range(16):
        along = 0.47 * size_px * np.array([math.sin(step * math.pi / 16), -math.cos(step * math.pi / 16)])
        ends = np.rint(16 * (middle + np.array([-along, along]))).astype(int).tolist()
        cv2.line(canvas, ends[0], ends[1], 0, 2, cv2.LINE_AA, shift=4)
    return canvas


def sloping_lines(width_px: int = 390, height_px: int = 317) -> Image:
    """Three lines on an even ground ([Ceron] 3.4.1, figure 3.13)."""
    canvas = np.full((height_px, width_px), 230, dtype=np.uint8)
    for shift_px in (-60, 0, 60):
        cv2.line(canvas, (shift_px, 0), (width_px + shift_px, height_px), 20, 2, cv2.LINE_AA)
    return canvas


def median_times_ms(tasks: Sequence[Callable[[], object]], repeats: int) -> list[float]:
    """Median time [ms] of each task; they take turns, so that a disturbance meets them all."""
    times_ms: list[list[float]] = [[] for _ in tasks]
    for _ in range(repeats):
        for task, own in zip(tasks, times_ms, strict=True):
            begin_s = time.perf_counter()
            task()
            own.append(1e3 * (time.perf_counter() - begin_s))
    return [statistics.median(own) for own in times_ms]


def edlines_alone(grey: Image) -> Callable[[], object]:
    """EDLines' own edges and lines and nothing else."""
    drawing = cv2.ximgproc.createEdgeDrawing()

    def run() -> object:
        drawing.detectEdges(grey)
        return drawing.detectLines()

    return run


def compared(finders: dict[Detector, LineFinder], grey: Image, repeats: int) -> list[float]:
    """Times [ms]: Canny, EDLines alone, then the whole way from the grey image to the angle with each detector."""
    tasks: list[Callable[[], object]] = [lambda: find_edges(grey, 1.0, 0.96, 0.4, 2.0), edlines_alone(grey)]
    tasks += [lambda finder=finder: finder.find(grey) for finder in finders.values()]  # type: ignore[misc]
    return median_times_ms(tasks, repeats)


def photographs(data: Path) -> list[Image]:
    """Every so manieth PLD photograph, grey and lying."""
    paths = sorted(data.glob("pld/*/*.jpg"))
    chosen = paths[:: max(1, len(paths) // N_PHOTOGRAPHS)][:N_PHOTOGRAPHS]
    greys = [to_grey(scoring.read_image(path)) for path in chosen]
    return [grey if grey.shape[1] > grey.shape[0] else np.ascontiguousarray(np.rot90(grey)) for grey in greys]


def scaled(grey: Image, width_px: int) -> Image:
    """The image with a width of `width_px`, and 3 : 4."""
    return np.asarray(cv2.resize(grey, (width_px, round(0.75 * width_px))), dtype=np.uint8)


def times_table(finders: dict[Detector, LineFinder], greys: list[Image], repeats: int) -> str:
    """Table 3.1 of [Ceron], on drawn images and on photographs of several sizes."""
    cases = [("radial pattern, 333 x 333", [radial_pattern()]), ("sloping lines, 390 x 317", [sloping_lines()])]
    cases += [
        (f"photographs, {width_px} x {round(0.75 * width_px)}", [scaled(grey, width_px) for grey in greys])
        for width_px in WIDTHS_PX
        if greys
    ]
    rows = []
    for name, images in cases:
        times_ms = np.array([compared(finders, image, repeats) for image in images])
        medians_ms = np.median(times_ms, axis=0).tolist()
        ratio = float(np.median(times_ms[:, 2] / times_ms[:, 1]))
        rows.append([name, *(f"{value:.1f}" for value in medians_ms), f"{ratio:.2f}"])
    return table(["[ms]", "Canny alone", "EDLines alone", *finders, "projection / EDLines alone"], rows)


def growth_table(finder: LineFinder, grey: Image, repeats: int) -> str:
    """Time of the projection over the number of pixels."""
    rows = []
    for megapixels in MEGAPIXELS:
        image = scaled(grey, round(math.sqrt(megapixels * 1e6 / 0.75)))
        finder.find(image)  # buffers of this size
        (time_ms,) = median_times_ms([lambda image=image: finder.find(image)], repeats)  # type: ignore[misc]
        rows.append([f"{megapixels:g}", f"{time_ms:.1f}", f"{time_ms / megapixels:.1f}"])
    return table(["megapixels", "ms", "ms per megapixel"], rows)


def radial_table(finders: dict[Detector, LineFinder]) -> str:
    """How many of the radial pattern's 16 directions each detector finds, within 1 degree, and the worst error."""
    rows = []
    for name, finder in finders.items():
        angles_rad = segment_angles_rad(finder.find(radial_pattern()).segments)
        errors_deg = [
            math.degrees(float(line_angle_distance_rad(angles_rad, step * math.pi / 16).min(initial=math.pi)))
            for step in range(16)
        ]
        found = [error for error in errors_deg if error <= 1.0]
        rows.append([name, f"{len(found)} of 16", f"{max(found, default=math.nan):.2f}"])
    return table(["detector", "directions found", "worst angle error [deg]"], rows)


def accuracy_tables(finders: dict[Detector, LineFinder], data: Path) -> str:
    """Precision, recall, angle and presence on the photographs, and [Ceron]'s count of true and false lines."""
    rows, counts = [], []
    folders = sorted(path for path in data.glob("pld/*") if path.is_dir())
    for (name, finder), folder in itertools.product(finders.items(), folders):
        score = scoring.score_pld(finder, folder)
        rows.append(
            [
                name,
                f"{folder.name} ({score.n_images})",
                *(f"{value:.3f}" for value in (score.precision, score.recall, score.f_measure, score.present)),
                f"{score.within_5_deg:.3f} ({len(score.errors_deg)})",
                f"{statistics.median(score.errors_deg):.2f}",
            ]
        )
        n_true, n_false, n_missed = scoring.count_lines(finder, folder)
        share = n_true / max(1, n_true + n_false)
        counts.append([name, folder.name, str(n_true), str(n_false), str(n_missed), f"{share:.2f}"])
    parts = [
        table(
            [
                "detector",
                "images",
                "precision",
                "recall",
                "F",
                "present",
                "angle within 5 deg",
                "its median error [deg]",
            ],
            rows,
        ),
        "All lines that a detector gives before any is chosen ([Ceron] tables 3.2 and 3.3):",
        table(["detector", "images", "true", "false", "conductors missed", "precision"], counts),
    ]
    others = []
    for name, finder in finders.items():
        nadir_deg = scoring.score_nadir(finder, data / "nadir" / "line_angle.csv")
        empty = [f"{scoring.false_presence(finder, data / folder):.3f}" for folder in ("no_line", "no_tower")]
        others.append(
            [name, ", ".join(f"{error:.2f}" for error in nadir_deg), f"{statistics.median(nadir_deg):.2f}", *empty]
        )
    columns = ["detector", "nadir errors [deg]", "median", "present on no_line", "present on no_tower"]
    return "\n\n".join([*parts, table(columns, others)])


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--data", type=Path, help="folder that holds the labelled photographs")
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--out", type=Path, default=PAGE)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    finders = {name: LineFinder(VisionSettings(detector=name)) for name in DETECTORS}
    for finder in finders.values():
        finder.warm_up()
    greys = photographs(options.data) if options.data else []
    parts = [
        "`make bench-vision DATA=FOLDER` regenerates this section: every detector through the same judgement of what "
        "is a conductor, side by side in one run, one thread, medians. `benchmarks/scoring.py` is the scorer. Times "
        "are from the grey image to the angle; a machine's load moves them all, so compare along a row.",
        "### Times ([Ceron] table 3.1)\n\n" + times_table(finders, greys, options.repeats),
        "Growth of the projection's time with the image:\n\n"
        + growth_table(finders["projection"], greys[0] if greys else radial_pattern(), options.repeats),
        "### Radial pattern ([Ceron] figure 3.15)\n\n" + radial_table(finders),
    ]
    parts.append("### The worker\n\n" + worker_text(options.data, seconds=40.0, n_starts=5))
    if options.data:
        parts.append("### Photographs ([Ceron] 3.5 and table 6.1)\n\n" + accuracy_tables(finders, options.data))
    text = "\n\n".join(parts)
    print(text)
    write_section("Vision", text, options.out)


if __name__ == "__main__":
    main()
