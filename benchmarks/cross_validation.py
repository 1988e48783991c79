"""Cross-validate the thresholds that were chosen on the very photographs they are scored on.

    python -m benchmarks.cross_validation --data FOLDER [--folds N]

The labelled photographs are dealt into folds. For each fold the thresholds are chosen anew on all the others, one
threshold after the other until none gets better, starting from values that are round on purpose; then they are scored
on the fold. Held-out scores near those of the shipped thresholds say that these were not fitted to single images.
"""

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks import scoring
from benchmarks.page import PAGE, table, write_section
from vision.pipeline import LineFinder, VisionSettings

Choice = tuple[float, ...]
Scores = NDArray[np.float64]


def _with_projection(name: str) -> Callable[[VisionSettings, float], VisionSettings]:
    return lambda base, value: replace(base, projection=replace(base.projection, **{name: value}))


def _plain(name: str) -> Callable[[VisionSettings, float], VisionSettings]:
    return lambda base, value: replace(base, **{name: value})


def _degrees(name: str) -> Callable[[VisionSettings, float], VisionSettings]:
    return lambda base, value: replace(base, **{name: math.radians(value)})


LINES: dict[str, tuple[Sequence[float], float, Callable[[VisionSettings, float], VisionSettings]]] = {
    "projection.min_coherence": ((0.2, 0.25, 0.3, 0.35, 0.4), 0.25, _with_projection("min_coherence")),
    "projection.min_contrast": ((1.5, 2.5, 4.0, 6.0), 4.0, _with_projection("min_contrast")),
    "max_conductor_width_share": ((0.02, 0.03, 0.04, 0.05), 0.05, _plain("max_conductor_width_share")),
    "pair_max_turn_rad [deg]": ((1.5, 2.0, 2.5, 3.5, 5.0), 5.0, _degrees("pair_max_turn_rad")),
    "min_coherence": ((0.4, 0.5, 0.55, 0.6, 0.65, 0.7), 0.5, _plain("min_coherence")),
    "min_contrast": ((4.0, 6.0, 8.0, 12.0, 16.0), 10.0, _plain("min_contrast")),
    "main_angle_tolerance_rad [deg]": ((7.5, 10.0, 15.0, 20.0), 10.0, _degrees("main_angle_tolerance_rad")),
    "min_relative_support": ((0.5, 0.6, 0.65, 0.7, 0.75, 0.8), 0.5, _plain("min_relative_support")),
    "min_relative_contrast": ((0.2, 0.3, 0.35, 0.4, 0.5), 0.5, _plain("min_relative_contrast")),
}
"""The thresholds that choose lines: candidate values, the round value to start from, and how a value is set."""

PRESENCE: dict[str, tuple[Sequence[float], float, Callable[[VisionSettings, float], VisionSettings]]] = {
    "presence_min_support": ((0.5, 0.55, 0.6, 0.64, 0.68, 0.72, 0.76, 0.8), 0.5, _plain("presence_min_support")),
    "presence_min_sigmas": ((0.0, 8.0, 9.0, 10.0, 10.5, 11.0, 12.0), 0.0, _plain("presence_min_sigmas")),
}
"""The thresholds that say whether there is a line."""

Knobs = dict[str, tuple[Sequence[float], float, Callable[[VisionSettings, float], VisionSettings]]]


def settings_of(knobs: Knobs, choice: Choice) -> VisionSettings:
    """The shipped settings with the values of `choice`, one for each knob."""
    settings = VisionSettings()
    for value, (_, _, apply) in zip(choice, knobs.values(), strict=True):
        settings = apply(settings, value)
    return settings


class Bench:
    """Scores every image under a choice of thresholds, once."""

    def __init__(self, knobs: Knobs, score: Callable[[LineFinder], Scores]) -> None:
        self._knobs = knobs
        self._score = score
        self._known: dict[Choice, Scores] = {}

    def scores(self, choice: Choice) -> Scores:
        """One row for each image."""
        if choice not in self._known:
            self._known[choice] = self._score(LineFinder(settings_of(self._knobs, choice)))
            print(f"\r{len(self._known)} choices of thresholds scored", end="", flush=True)
        return self._known[choice]

    def best(self, images: NDArray[np.bool_], merit: Callable[[Scores], float]) -> Choice:
        """Choose on some images: one threshold after the other, again and again, until none gets better."""
        choice = tuple(start for _, start, _ in self._knobs.values())
        merit_now = merit(self.scores(choice)[images])
        is_better = True
        while is_better:
            is_better = False
            for knob, (values, _, _) in enumerate(self._knobs.values()):
                for value in values:
                    other = (*choice[:knob], value, *choice[knob + 1 :])
                    merit_there = merit(self.scores(other)[images])
                    if merit_there > merit_now + 1e-4:
                        choice, merit_now, is_better = other, merit_there, True
        return choice


def f_measure(scores: Scores) -> float:
    """F of the mean precision and the mean recall over images, (n, 2)."""
    precision, recall = scores.mean(axis=0)
    return float(2 * precision * recall / (precision + recall)) if precision + recall else 0.0


def presence_merit(scores: Scores) -> float:
    """Of (n, 2) whether a line is there and whether one was said to be: the mean of both shares that are right."""
    is_there, is_said = scores.T > 0.5
    return float(0.5 * np.mean(is_said[is_there]) + 0.5 * np.mean(~is_said[~is_there]))


def line_scores(finder: LineFinder, images: list[tuple[NDArray[np.uint8], NDArray[np.uint8]]]) -> Scores:
    """Precision and recall of each image."""
    return np.array([scoring.precision_recall(finder.find(image).power_lines, labels) for image, labels in images])


def validate(
    knobs: Knobs, score: Callable[[LineFinder], Scores], n_images: int, n_folds: int, merit: Callable[[Scores], float]
) -> tuple[Scores, Scores, str]:
    """Held-out scores of each image, those under the shipped thresholds, and a table of what each fold chose."""
    bench = Bench(knobs, score)
    fold_of = np.random.default_rng(1).permutation(n_images) % n_folds
    held_out = np.empty((n_images, 2))
    rows = []
    for fold in range(n_folds):
        choice = bench.best(fold_of != fold, merit)
        held_out[fold_of == fold] = bench.scores(choice)[fold_of == fold]
        rows.append([str(fold + 1), *(f"{value:g}" for value in choice)])
    print()
    return held_out, score(LineFinder(VisionSettings())), table(["fold", *knobs], rows)


def main() -> None:
    """Cross-validate, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--data", type=Path, required=True, help="folder that holds the labelled photographs")
    parser.add_argument("--folds", type=int, default=5)
    parser.add_argument("--out", type=Path, default=PAGE)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    parts = [
        "`python -m benchmarks.cross_validation --data FOLDER` regenerates this section. The labelled photographs are "
        f"dealt into {options.folds} folds; for each, the thresholds are chosen on the others, from round values on, "
        "and scored on it.",
    ]
    folders = sorted(path for path in options.data.glob("pld/*") if path.is_dir())
    sets = [list(scoring.labelled_images(folder)) for folder in folders]
    images = [pair for pairs in sets for pair in pairs]
    of_set = np.repeat(np.arange(len(sets)), [len(pairs) for pairs in sets])
    held_out, shipped, choices = validate(
        LINES, lambda finder: line_scores(finder, images), len(images), options.folds, f_measure
    )
    rows = [
        [folder.name, *(f"{f_measure(scores[of_set == i]):.3f}" for scores in (held_out, shipped))]
        for i, folder in enumerate(folders)
    ]
    rows.append(["all", f"{f_measure(held_out):.3f}", f"{f_measure(shipped):.3f}"])
    parts += [table(["F", "held out", "shipped thresholds"], rows), "Each fold chose:\n\n" + choices]
    with_line = [image for image, _ in images]
    without = [scoring.read_image(path) for path in scoring.images_in(options.data / "no_line")]
    truth = np.repeat([1.0, 0.0], [len(with_line), len(without)])

    def presence_scores(finder: LineFinder) -> Scores:
        said = [float(finder.find(image).is_present) for image in (*with_line, *without)]
        return np.stack([truth, np.array(said)], axis=1)

    held_out, shipped, choices = validate(PRESENCE, presence_scores, len(truth), options.folds, presence_merit)
    rows = [
        [name, *(f"{np.mean((scores[truth == there] > 0.5)[:, 1]):.3f}" for scores in (held_out, shipped))]
        for name, there in (("with a line", 1.0), ("without (no_line)", 0.0))
    ]
    parts += [table(["said to be present", "held out", "shipped thresholds"], rows), "Each fold chose:\n\n" + choices]
    text = "\n\n".join(parts)
    print(text)
    write_section("Thresholds, cross-validated", text, options.out)


if __name__ == "__main__":
    main()
