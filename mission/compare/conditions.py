"""Conditions on a comparison's figures, as `lateral_p95_m>0.5` or `change:latency_p95_ms>20`. Pure."""

import difflib
import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from mission.compare.figures import Figures

_PATTERN = re.compile(r"\s*(change:)?\s*(\w+)\s*(<=|>=|<|>)\s*(\S+)\s*")
_OPERATORS: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    ">": operator.gt,
    "<=": operator.le,
    ">=": operator.ge,
}


class ConditionError(Exception):
    """What is no condition on these figures; the message is one sentence for a person."""


@dataclass(frozen=True, slots=True)
class Condition:
    """A figure held against a number: of the last flight, or its change from the first one (`is_change`)."""

    name: str
    sign: str
    limit: float
    is_change: bool

    def failure(self, first: Figures, last: Figures) -> str | None:
        """Why it fails, in a sentence: it holds, or cannot be judged; None where all is well."""
        value, before = last.get(self.name), first.get(self.name)
        what = self.name
        if self.is_change:
            what = f"the change of {self.name}"
            value = None if value is None or before is None else value - before
        if value is None:
            return f"{what} is not known, so that {self} cannot be judged"
        return f"{what} is {value:.4g}, which is {self.sign} {self.limit:g}" if self._holds(value) else None

    def _holds(self, value: float) -> bool:
        return _OPERATORS[self.sign](value, self.limit)

    def __str__(self) -> str:
        return f"{'change:' if self.is_change else ''}{self.name}{self.sign}{self.limit:g}"


def parse_condition(text: str, known: Sequence[str]) -> Condition:
    """Read a condition on one of the `known` figures. Raises ConditionError."""
    match = _PATTERN.fullmatch(text)
    limit = None if match is None else _number(match[4])
    if match is None or limit is None:
        raise ConditionError(
            f"'{text}' is no condition; write a figure, <, >, <= or >=, and a number: lateral_p95_m>0.5."
        )
    change, name, sign, _ = match.groups()
    if not math.isfinite(limit):
        example = f"{change or ''}{name}{sign}0.5"
        raise ConditionError(f"'{text}' would always hold, or never; write a finite number: {example}.")
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(sorted(known))}."
        raise ConditionError(f"There is no figure '{name}' in '{text}'; {hint}")
    return Condition(name, sign, limit, change is not None)


def _number(text: str) -> float | None:
    """A number as Python reads it, also `.5`, `1e+3` and `nan`; None for what is none."""
    try:
        return float(text)
    except ValueError:
        return None
