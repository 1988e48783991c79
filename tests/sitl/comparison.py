"""Compares what a simulated autopilot answered in a replay with a golden record: kinds, order, values and times."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tests.sitl.replay import Replay

LEAST_S, SHARE = 0.5, 0.2  # how far a moment may be off, the larger: in seconds, and of the time since the last input
LANDING_SHARE = 0.45  # what PX4's own landings from the same 10 m differ by: 13 to 22 s until it calls them landed
LANDED = ("Landing detected", "Disarmed by landing")

PERIODS_S = {
    "ack": 0.0,
    "message_ack": 0.0,
    "text": 0.0,
    "parameter": 0.0,
    "heartbeat": 1.0,
    "landed": 1.0,
    "current_mode": 2.0,
    "health": 0.2,
}
"""The streams that are compared. A state that is told once in a period is seen up to a period later, or not at all."""


@dataclass(frozen=True)
class Entry:
    """An answer: when [s], and what."""

    at_s: float
    what: tuple[Any, ...]


def differences(record: dict[str, Any], replay: Replay, exceptions: Mapping[str, str]) -> list[str]:
    """A side by side listing of each stream that differs; empty when the replay conforms.

    `exceptions` are regular expressions for the answers, written as the listing writes them, that are left out.
    """
    found = [replay.in_vain] if replay.in_vain else []
    for stream, period_s in PERIODS_S.items():
        recorded = entries(stream, record.get(stream, []), list(exceptions))
        ours = entries(stream, replay.answers.get(stream, []), list(exceptions))
        lines, is_same = listing(recorded, ours, Judge(record["end_s"], replay, period_s))
        if not is_same:
            found += [f"--- {stream}: recorded, expected here, heard", *lines]
    return found


@dataclass(frozen=True)
class Judge:
    """Says how late an answer may come, and whether one may be missing."""

    end_s: float
    replay: Replay
    period_s: float

    def room_s(self, what: tuple[Any, ...], since_s: float) -> float:
        """By how much an answer may be off that came `since_s` after the last input."""
        is_landing = any(str(part).startswith(LANDED) for part in what)
        return max(LEAST_S, (LANDING_SHARE if is_landing else SHARE) * since_s) + self.period_s

    def may_miss(self, entry: Entry, until_s: float, *, is_recorded: bool) -> bool:
        """Whether an answer, in force until the next one, is too short or too close to the end to be required."""
        end_s = self.end_s if is_recorded else self.replay.expected(self.end_s)[0]
        since_s = self.replay.since_input_s(entry.at_s, is_recorded=is_recorded)
        # How a landing went decides when all that follows comes.
        is_at_end = entry.at_s + max(self.room_s(entry.what, since_s), LANDING_SHARE * since_s) > end_s
        return is_at_end or (self.period_s > 0 and until_s - entry.at_s < self.period_s + LEAST_S)


def entries(stream: str, records: list[list[Any]], exceptions: list[str]) -> list[Entry]:
    """A stream's answers, without the exceptions and without what repeats then."""
    kept: list[Entry] = []
    for at_s, *what in records:
        value = tuple(loose(part) for part in what)
        if any(re.match(pattern, f"{stream} {written(what)}") for pattern in exceptions):
            continue
        if not (PERIODS_S[stream] and kept and kept[-1].what == value):
            kept.append(Entry(at_s, value))
    return kept


def loose(part: Any) -> Any:
    """A value as it is compared: heights in a text depend on where the vehicle just was."""
    return re.sub(r"\d+ m\b", "# m", part) if isinstance(part, str) else part


def written(what: Any) -> str:
    """An answer for a person."""
    return " ".join(f"{part:#x}" if isinstance(part, int) and part > 255 else str(part).strip() for part in what)


def listing(recorded: list[Entry], ours: list[Entry], judge: Judge) -> tuple[list[str], bool]:
    """The two side by side, and whether they agree."""
    lines, is_same = [], True
    left_free = [judge.may_miss(*pair, is_recorded=True) for pair in with_ends(recorded)]
    right_free = [judge.may_miss(*pair, is_recorded=False) for pair in with_ends(ours)]
    for i, j in aligned(recorded, ours, left_free, right_free):
        mark, times, heard = "  ", " " * 17, " " * 8
        if i is not None:
            expected_s, since_s = judge.replay.expected(recorded[i].at_s)
            times = f"{recorded[i].at_s:8.3f} {expected_s:8.3f}"
            if j is None:
                mark = "  " if left_free[i] else "<-"
            elif abs(ours[j].at_s - expected_s) > judge.room_s(ours[j].what, since_s):
                mark = "!!"
        elif j is not None:
            mark = "  " if right_free[j] else "->"
        if j is not None:
            heard = f"{ours[j].at_s:8.3f}"
        what = recorded[i].what if i is not None else ours[j or 0].what
        is_same = is_same and mark == "  "
        lines.append(f"{mark} {times} {heard}  {written(what)}")
    return lines, is_same


def with_ends(sequence: list[Entry]) -> list[tuple[Entry, float]]:
    """Each entry, and when the next one came."""
    ends_s = [entry.at_s for entry in sequence[1:]] + [math.inf]
    return list(zip(sequence, ends_s, strict=False))


def aligned(
    left: list[Entry], right: list[Entry], left_free: list[bool], right_free: list[bool]
) -> list[tuple[int | None, int | None]]:
    """Pair equal entries in order by their places, leaving out as few as can be of those that may not be missing."""
    costs = [[0.0] * (len(right) + 1) for _ in range(len(left) + 1)]
    for i in range(len(left), -1, -1):
        for j in range(len(right), -1, -1):
            choices = []
            if i < len(left):
                choices.append((0.1 if left_free[i] else 1.0) + costs[i + 1][j])
            if j < len(right):
                choices.append((0.1 if right_free[j] else 1.0) + costs[i][j + 1])
            if i < len(left) and j < len(right) and left[i].what == right[j].what:
                choices.append(costs[i + 1][j + 1])
            costs[i][j] = min(choices, default=0.0)
    pairs: list[tuple[int | None, int | None]] = []
    i = j = 0
    while i < len(left) or j < len(right):
        is_pair = i < len(left) and j < len(right) and left[i].what == right[j].what
        if is_pair and costs[i][j] == costs[i + 1][j + 1]:
            pairs.append((i, j))
            i, j = i + 1, j + 1
        elif i < len(left) and costs[i][j] == (0.1 if left_free[i] else 1.0) + costs[i + 1][j]:
            pairs.append((i, None))
            i += 1
        else:
            pairs.append((None, j))
            j += 1
    return pairs
