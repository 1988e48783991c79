"""Reading a mission file: a MissionPlan, or every error at once with file, line and key."""

import difflib
import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from drivers.camera.camera import CameraError, Intrinsics
from mission.camera_plan import planned_camera
from mission.plan import TASK_MODELS, MissionPlan, SafetyPlan
from mission.plan_checks import check_plan
from mission.plan_rules import RuleBreak, check_rules
from mission.yaml_document import Document, DocumentError, Location, Problem, key_path, parse_document

MAX_BYTES = 256 * 1024
"""A mission of 200 tasks needs 20 KB; what is larger is not a mission file."""

_MAX_SHOWN_CHARACTERS = 60
_MAX_SHOWN_PROBLEMS = 40


class MissionFileError(Exception):
    """A mission file that cannot be flown; `problems` holds all that is wrong, in the file's order."""

    def __init__(self, path: Path, problems: list[Problem]) -> None:
        self.path = path
        self.problems = sorted(problems, key=lambda problem: problem.line)
        super().__init__("\n".join(self.lines()))

    def lines(self) -> list[str]:
        """`file:line: key: what is wrong`, one for each problem."""
        shown = [
            f"{self.path}:" + _printable(": ".join([str(problem.line), *filter(None, [problem.key]), problem.message]))
            for problem in self.problems[:_MAX_SHOWN_PROBLEMS]
        ]
        n_hidden = len(self.problems) - _MAX_SHOWN_PROBLEMS
        return [*shown, f"{self.path}: and {n_hidden} more problems"] if n_hidden > 0 else shown


@dataclass(frozen=True, slots=True)
class MissionFile:
    """A mission file that was read: the plan, the text that the log keeps, and the camera that the plan means."""

    path: Path
    text: str
    plan: MissionPlan
    camera: Intrinsics

    @property
    def sha256(self) -> str:
        """The hex digest of its text as UTF-8."""
        return hashlib.sha256(self.text.encode()).hexdigest()


def read_mission(path: Path) -> MissionFile:
    """Read and check a mission file; raises MissionFileError with everything that is wrong."""
    text = _read_text(path)
    try:
        document = parse_document(text)
    except DocumentError as error:
        raise MissionFileError(path, error.problems) from None
    data = document.data
    if not isinstance(data, dict):
        words = f"found {_show(data)}; a mission is a mapping with version, name and tasks"
        raise MissionFileError(path, [Problem(1, "", words)])
    problems = _rule_problems(data, document)
    try:
        plan = MissionPlan.model_validate(data)
    except ValidationError as error:
        found = [_problem(details, document) for details in error.errors()]
        raise MissionFileError(path, _merge_alternatives(found) + problems) from None
    problems = problems or [_rule_problem(broken, document) for broken in check_plan(plan)]
    if problems:
        raise MissionFileError(path, problems)
    try:
        camera = planned_camera(plan.camera, path.parent)
    except CameraError as error:
        at = ("camera", "calibration")
        raise MissionFileError(path, [Problem(document.line(at), key_path(at), str(error))]) from None
    return MissionFile(path, text, plan, camera)


def schema_text() -> str:
    """The JSON Schema of mission files, as missions/mission.schema.json holds it."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **MissionPlan.model_json_schema()}
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def _read_text(path: Path) -> str:
    def refuse(words: str) -> MissionFileError:
        return MissionFileError(path, [Problem(1, "", words)])

    try:
        if path.is_dir():
            raise refuse("this is a folder; name a mission file")
        with path.open("rb") as file:
            raw = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise refuse("there is no such file; missions/ holds examples") from None
    except OSError as error:
        raise refuse(f"cannot be read: {error.strerror}") from None
    except ValueError:
        raise refuse("no file can have this name") from None
    if len(raw) > MAX_BYTES:
        raise refuse(f"larger than {MAX_BYTES // 1024} KB, so this is not a mission file")
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError:
        raise refuse("not text (UTF-8), so this is not a mission file") from None
    if not text.strip():
        raise refuse("empty; a mission needs version, name and tasks")
    return text


def _rule_problems(data: dict[object, object], document: Document) -> list[Problem]:
    tasks, safety = data.get("tasks"), data.get("safety")
    fence_m = safety.get("max_altitude_m") if isinstance(safety, dict) else None
    if fence_m is None:
        fence_m = SafetyPlan.model_fields["max_altitude_m"].default
    return [
        _rule_problem(broken, document) for broken in check_rules(tasks if isinstance(tasks, list) else [], fence_m)
    ]


def _rule_problem(broken: RuleBreak, document: Document) -> Problem:
    words = f"found {broken.found}; allowed: {broken.allowed}"
    return Problem(document.line(broken.location), key_path(broken.location), words)


def _problem(details: ErrorDetails, document: Document) -> Problem:
    """Say pydantic's error in the words of a mission file: what was found, what is allowed."""
    model, location = _model_at(details["loc"])
    kind, context = details["type"], details.get("ctx", {})
    if kind == "extra_forbidden" and model is not None:
        allowed = [name for name in model.model_fields if name != "task"]
        near = difflib.get_close_matches(str(location[-1]), allowed, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]}? " if near else ""
        words = f"unknown key; {hint}allowed: {', '.join(allowed)}"
    elif kind == "missing":
        words = "missing; this key must be given"
    elif kind == "union_tag_invalid":
        location = (*location, "task")
        words = f"found {context['tag']}; allowed: {str(context['expected_tags']).replace(chr(39), '')}"
    elif kind in ("union_tag_not_found", "model_attributes_type"):
        words = f"found {_show(details['input'])}; allowed: a mapping with a key named task, e.g. {{task: land}}"
    elif kind == "model_type":
        words = f"found {_show(details['input'])}; allowed: a mapping of keys"
    elif kind == "string_pattern_mismatch":
        words = f"found {_show(details['input'])}; allowed: {context['pattern']} (as a regular expression)"
    elif kind == "too_short":
        words = f"found {_show(details['input'])}; allowed: at least {context['min_length']}"
    elif kind == "float_type":
        words = f"found {_show(details['input'])}; allowed: a plain number, the unit is in the key's name"
    else:
        message = details["msg"].removeprefix("Input should be ")
        words = f"found {_show(details['input'])}; allowed: {message}"
    return Problem(document.line(location), key_path(location), words)


def _model_at(location: Location) -> tuple[type[BaseModel] | None, Location]:
    """The section that a pydantic location points into, and the location as the file has it.

    pydantic writes a union's tag behind a task's index (`tasks, 3, align, turn`), and a branch's name behind a key
    that takes several types (`distance_m, float`); the file has neither.
    """
    if location[:1] == ("tasks",):
        tag = location[2] if len(location) > 2 else None
        return TASK_MODELS.get(str(tag)), (*location[:2], *location[3:4])
    model: type[BaseModel] = MissionPlan
    for part in location[:-1]:
        field = model.model_fields.get(str(part))
        if field is None or not isinstance(field.annotation, type) or not issubclass(field.annotation, BaseModel):
            break
        model = field.annotation
    return model, location


def _merge_alternatives(problems: list[Problem]) -> list[Problem]:
    """A key that takes several types yields an error for each; say them as one."""
    merged: dict[tuple[int, str], Problem] = {}
    for problem in problems:
        place = (problem.line, problem.key)
        if place in merged and "; allowed: " in problem.message:
            words = f"{merged[place].message}, or {problem.message.split('; allowed: ', 1)[1]}"
            merged[place] = Problem(problem.line, problem.key, words)
        else:
            merged.setdefault(place, problem)
    return list(merged.values())


def _show(value: object) -> str:
    if value is None:
        return "nothing"
    try:
        text = json.dumps(value, default=str, ensure_ascii=False)
    except (TypeError, ValueError):  # keys that JSON does not have: dates, bytes
        text = str(value)
    return text if len(text) <= _MAX_SHOWN_CHARACTERS else text[:_MAX_SHOWN_CHARACTERS] + "…"


def _printable(text: str) -> str:
    """One line that every terminal can take: what a file holds may be line breaks, escapes or half characters."""
    return "".join(letter if letter.isprintable() else letter.encode("unicode_escape").decode() for letter in text)
