"""Find lines in rendered pictures as in photographs, hold the two beside each other, and write docs/benchmarks.md.

    python -m benchmarks.rendered_lines [--data FOLDER] [--n N] [--worlds W ...] [--keep FOLDER] [--out FILE]

FOLDER holds labelled photographs (benchmarks/scoring.py says how); without it only rendered pictures are measured.
"""

import argparse
import math
import multiprocessing
import os
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks import scoring
from benchmarks.page import PAGE, table, write_section
from benchmarks.realism import Figures, figures_table, measure
from sitl.render.lens import pinhole
from sitl.render.photographer import Photographer
from sitl.render.renderer import Renderer
from sitl.render.truth.sampling import sample_view
from sitl.render.truth.truth import MaskValue, TruthFinder
from sitl.world.file import load_world, shipped_worlds
from sitl.world.light import LIGHT_NAMES, LightName
from sitl.world.surface import surface_of
from vision.pipeline import LineFinder, VisionSettings

WIDTH_PX, HEIGHT_PX, HFOV_RAD = 640, 480, math.radians(80.0)
ABOVE_WIRES_M = (4.0, 8.0)
BESIDE_M = 1.5
LEAST_LABELLED_PX = 150  # a view that shows less of the line is none of the line
WORTH_A_LOOK = 0.9
AIM = 0.05

Image = NDArray[np.uint8]

WHAT_GOES_WRONG = """
What is false is on the ground and long: over the forest the two wheel tracks of the farm track that runs along the
line, in the village the strip of longer grass under a fence, there and over the high-voltage line the white edges
of a road, in the fields the rows of crops, where they stand out more than the conductors and then take the whole
frame. Photographs have all of these; those of PLD seldom along the line. What is missed: the conductors of a second
line that crosses, because only one direction is kept; the bundle on the other side of the frame where the nearer
one stands out three times as much, because the conductors of one line are taken to look alike; in the village a
conductor right over the edge of the grass under a fence. Thin conductors are not what is missed. In flight a frame
does not decide alone: what lies on the ground is told by its parallax, and a line that jumps sideways is another
one ([0014](decisions/0014-recognising-the-line.md)); [benchmarks-following.md](benchmarks-following.md) tells what
is left.
"""

WHERE_THEY_DIFFER = """
Medians over the pictures, in brackets the tenth and the ninetieth percentile. Gradients are in grey levels per
pixel, local contrast is the standard deviation by the mean of blocks of 16 pixels, the slope is the exponent of the
spectrum's power; a conductor's width is that of its profile at half its height, along the labels, and its contrast
is that profile's height, in grey levels and in standard deviations of the ground beside it. The spectrum's slope,
the middle gradients and how far a conductor stands out from its ground are those of photographs. The rest is not:
rendered pictures are all equally bright, because each is exposed for itself, while PLD's are cut from larger ones;
they have about half of the contrast, within blocks as over the whole frame, and half of the steepest gradients,
because nothing in them is black between leaves or white like gravel and zinc; their ground is twice as colourful.
Their conductors are thinner and stand out less in grey levels, which makes them harder to find, over a ground that
is calmer, which makes it easier by as much. The photographs of the nadir set, taken from higher, at twice the
pixels and sharpened, are rougher than all others.
"""


@dataclass(frozen=True, slots=True)
class Scored:
    """One rendered picture: where, in which light, how well the lines were found, and what it is like."""

    world: str
    light: str
    index: int
    precision: float
    recall: float
    is_present: bool
    figures: Figures


def outlined(labels: Image) -> Image:
    """Labels (h, w) as PLD's are drawn: of what is three pixels wide or more, the edges alone."""
    inside = cv2.erode(labels, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_REPLICATE)
    return np.where(inside > 0, 0, labels).astype(np.uint8)


def pictures(world: str, light: LightName, n: int) -> Iterator[tuple[Image, Image]]:
    """`n` pictures of a world, (h, w, 3) BGR, and their labels, (h, w): the same views in every light."""
    scene = load_world(world, light)
    surface = surface_of(scene)
    renderer = Renderer(scene, pinhole(WIDTH_PX, HEIGHT_PX, HFOV_RAD))
    photographer, truth_finder = Photographer(renderer), TruthFinder(renderer)
    seed, n_taken = 0, 0
    while n_taken < n:
        rng = np.random.default_rng((1, seed))
        motion = sample_view(scene, surface, "down", rng, ABOVE_WIRES_M, BESIDE_M).motion
        mask = truth_finder.find(motion.pose).mask
        is_wire = (mask == MaskValue.CONDUCTOR) | (mask == MaskValue.SHIELD_WIRE)
        labels = outlined(is_wire.astype(np.uint8) * 255)
        if np.count_nonzero(labels) >= LEAST_LABELLED_PX:
            yield photographer.take_alone(motion, seed).image, labels
            n_taken += 1
        seed += 1


def score_world(task: tuple[str, int, Path | None]) -> list[Scored]:
    """Score a world in all lights; `task` is its name, the number of pictures for each, and where to keep them."""
    world, n, keep = task
    cv2.setNumThreads(1)
    finder = LineFinder(VisionSettings())
    scored = []
    for light in LIGHT_NAMES:
        for index, (image, labels) in enumerate(pictures(world, light, n)):
            detection = finder.find(image)
            precision, recall = scoring.precision_recall(detection.power_lines, labels)
            figures = measure(image, labels)
            scored.append(Scored(world, light, index, precision, recall, detection.is_present, figures))
            if keep is not None and f_measure(precision, recall) < WORTH_A_LOOK:
                name = f"{world}_{light}_{index:02d}_p{100 * precision:03.0f}_r{100 * recall:03.0f}.png"
                cv2.imwrite(str(keep / name), beside(image, labels, scoring.drawn(detection.power_lines, labels.shape)))
    return scored


def beside(image: Image, labels: Image, found: Image) -> Image:
    """The picture, and beside it what is labelled (green), found rightly (white) and found wrongly (red)."""
    is_right = scoring.distance_px(labels) <= scoring.tolerance_px(labels)
    marked = image // 3
    marked[labels > 0] = (0, 200, 0)
    marked[(found > 0) & is_right] = (255, 255, 255)
    marked[(found > 0) & ~is_right] = (0, 0, 255)
    return np.hstack([image, marked])


def f_measure(precision: float, recall: float) -> float:
    """Harmonic mean of a precision and a recall."""
    return 2 * precision * recall / (precision + recall) if precision + recall else 0.0


def score_of(scored: Sequence[Scored]) -> tuple[float, float, float]:
    """Mean precision, mean recall, and their F."""
    precision = float(np.mean([one.precision for one in scored]))
    recall = float(np.mean([one.recall for one in scored]))
    return precision, recall, f_measure(precision, recall)


def grouped(scored: Sequence[Scored], key: Callable[[Scored], str]) -> Iterator[tuple[str, list[Scored]]]:
    """The pictures of each value of a key."""
    for value in dict.fromkeys(key(one) for one in scored):
        yield value, [one for one in scored if key(one) == value]


def scores_row(name: str, scored: Sequence[Scored]) -> list[str]:
    """A line of the table of scores."""
    present = float(np.mean([one.is_present for one in scored]))
    return [name, str(len(scored)), *(f"{value:.3f}" for value in (*score_of(scored), present))]


def scores_text(scored: Sequence[Scored], data: Path | None) -> str:
    """Tables of scores: photographs and pictures, then pictures by world and light; how far apart they are."""
    rows = []
    finder = LineFinder(VisionSettings())
    folders = sorted(path for path in data.glob("pld/*") if path.is_dir()) if data else []
    rendered_f = score_of(scored)[2]
    photographs_f = []
    for folder in folders:
        score = scoring.score_pld(finder, folder)
        figures = (score.precision, score.recall, score.f_measure, score.present)
        rows.append([f"photographs, {folder.name}", str(score.n_images), *(f"{value:.3f}" for value in figures)])
        photographs_f.append((folder.name, score.f_measure))
    rows.append(scores_row("rendered, all", scored))
    rows += [scores_row(f"rendered, {light}", part) for light, part in grouped(scored, lambda one: one.light)]
    by_world = []
    for world, of_world in grouped(scored, lambda one: one.world):
        by_light = [f"{score_of(part)[2]:.3f}" for _, part in grouped(of_world, lambda one: one.light)]
        by_world.append([world, *(f"{value:.3f}" for value in score_of(of_world)), *by_light])
    by_f = [(world, score_of(part)[2]) for world, part in grouped(scored, lambda one: one.world)]
    words = filled(aim_text(rendered_f, by_f, photographs_f)) if photographs_f else ""
    return "\n\n".join(
        [
            words,
            table(["", "pictures", "precision", "recall", "F", "present"], rows),
            table(["world", "precision", "recall", "F", *(f"F, {light}" for light in LIGHT_NAMES)], by_world),
        ]
    )


def aim_text(rendered_f: float, worlds: Sequence[tuple[str, float]], photographs: Sequence[tuple[str, float]]) -> str:
    """Whether the aim is met: by all pictures together, and by each world."""
    words = []
    for name, real_f in photographs:
        is_met = abs(rendered_f - real_f) <= AIM
        words.append(f"{rendered_f - real_f:+.3f} from {name} ({'met' if is_met else 'missed'})")
    low = min(real_f for _, real_f in photographs) - AIM
    below = [f"{name} ({world_f:.3f})" for name, world_f in worlds if world_f < low]
    return (
        f"The aim is an F within {AIM:g} of that on photographs. All together it is {rendered_f:.3f}: "
        f"{', '.join(words)}. Worlds that are farther below both: {', '.join(below) or 'none'}. "
        "The mean is one of easy worlds, whose conductors alone are straight, and of hard ones, with straight things "
        "along the line."
    )


def photograph_figures(data: Path) -> Iterator[tuple[str, list[Figures]]]:
    """What the photographs are like, folder by folder."""
    nadir = [scoring.read_image(path) for path in scoring.images_in(data / "nadir")]
    yield "photographs, nadir", [measure(image, None) for image in nadir]
    for folder in sorted(path for path in data.glob("pld/*") if path.is_dir()):
        yield f"photographs, {folder.name}", [measure(*labelled) for labelled in scoring.labelled_images(folder)]


def figures_text(scored: Sequence[Scored], data: Path | None) -> str:
    """The table of what photographs and rendered pictures are like."""
    groups: list[tuple[str, Iterable[Figures]]] = list(photograph_figures(data)) if data else []
    groups.append(("rendered, all", [one.figures for one in scored]))
    groups += [
        (f"rendered, {light}", [one.figures for one in part]) for light, part in grouped(scored, lambda one: one.light)
    ]
    return figures_table(groups)


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--data", type=Path, help="folder that holds the labelled photographs")
    parser.add_argument("--n", type=int, default=40, help="pictures of each world in each light")
    parser.add_argument("--worlds", nargs="+", choices=shipped_worlds(), default=shipped_worlds())
    parser.add_argument("--processes", type=int, default=max(1, len(os.sched_getaffinity(0))))
    parser.add_argument("--keep", type=Path, help=f"a folder for what was found where F is below {WORTH_A_LOOK}")
    parser.add_argument("--out", type=Path, default=PAGE)
    options = parser.parse_args()
    if options.keep:
        options.keep.mkdir(parents=True, exist_ok=True)
    tasks = [(world, options.n, options.keep) for world in options.worlds]
    with multiprocessing.get_context("spawn").Pool(options.processes) as pool:
        scored = [one for of_world in pool.imap(score_world, tasks, chunksize=1) for one in of_world]
    how = (
        f"`make bench-rendered DATA=FOLDER` regenerates this section. {len(scored)} pictures of the shipped worlds, "
        f"{options.n} views of each in all four lights, {WIDTH_PX} x {HEIGHT_PX} and {math.degrees(HFOV_RAD):.0f} "
        f"degrees wide, from {ABOVE_WIRES_M[0]:g} to {ABOVE_WIRES_M[1]:g} m over the wires and supports near by, some "
        "metres beside the line, turned, tilted and moving as in flight. They are labelled from the truth as the "
        "photographs are, both edges of what is thick, and scored by the same scorer with the same detector. Neither "
        "detector nor renderer was tuned for it."
    )
    parts = [filled(how), "### The same detector", scores_text(scored, options.data), filled(WHAT_GOES_WRONG)]
    parts += ["### What the pictures are like", figures_text(scored, options.data), filled(WHERE_THEY_DIFFER)]
    text = "\n\n".join(parts)
    print(text)
    write_section("Rendered against real", text, options.out)


def filled(words: str) -> str:
    """A paragraph in lines as long as the documents have them."""
    return textwrap.fill(" ".join(words.split()), 120, break_long_words=False, break_on_hyphens=False)


if __name__ == "__main__":
    main()
