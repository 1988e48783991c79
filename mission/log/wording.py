"""What happened on a flight, in lines of text to read along."""

from typing import assert_never

from mission.log.records import StatusText
from mission.records import (
    CheckResult,
    Event,
    MissionEnded,
    PreflightCheck,
    Result,
    Severity,
    TaskEnded,
    TaskStarted,
)

Worded = PreflightCheck | Event | TaskStarted | TaskEnded | MissionEnded | StatusText

_CHECK_SEVERITY = {
    CheckResult.OK: Severity.INFO,
    CheckResult.WARNING: Severity.WARNING,
    CheckResult.FAILED: Severity.ERROR,
}


def line_of(record: Worded) -> tuple[str, Severity, str]:
    """Who speaks, how much it matters, and the line."""
    match record:
        case Event():
            reaction = "" if record.reaction == "continue" else f" [{words_of(record.reaction)}]"
            return "event", record.severity, f"{words_of(record.name)}: {record.message}{reaction}"
        case PreflightCheck():
            return "preflight", _CHECK_SEVERITY[record.result], f"{words_of(record.name)}: {record.reason}"
        case TaskStarted():
            return "mission", Severity.INFO, f"{words_of(record.task)} started"
        case TaskEnded():
            ended = f"{words_of(record.task)} {words_of(record.result)}"
            return "mission", severity_of(record.result), f"{ended}: {_reason(record)}"
        case MissionEnded():
            return "mission", severity_of(record.result), f"mission {words_of(record.result)}: {_reason(record)}"
        case StatusText():
            return "autopilot", Severity.INFO, record.text
        case _ as unreachable:
            assert_never(unreachable)


def _reason(record: TaskEnded | MissionEnded) -> str:
    """Why it ended, without the name of its result, which some reasons begin with and the line has said."""
    return record.reason.removeprefix(f"{words_of(record.result)}: ")


def severity_of(result: Result) -> Severity:
    """How much a result matters."""
    return {Result.COMPLETED: Severity.INFO, Result.FAILED: Severity.ERROR}.get(result, Severity.WARNING)


def words_of(result: str) -> str:
    """Spell a result as people write it: taken_over becomes 'taken over'."""
    return result.replace("_", " ")


def counted(n: int, noun: str) -> str:
    """Spell a count: 1 task, 2 tasks."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def with_unit(value: float, unit: str, digits: int = 2) -> str:
    """Spell a value with its unit: 0.25 m, 45°."""
    if unit in ("deg", "°"):
        return f"{value:.0f}°" if abs(value) >= 10.0 else f"{value:.1f}°"
    return f"{value:.{digits}f} {unit}"


def duration(seconds: float) -> str:
    """Spell a duration: 37 s, 1 min 33 s."""
    minutes, whole_s = divmod(round(seconds), 60)
    return f"{minutes} min {whole_s:02d} s" if minutes else f"{whole_s} s"


def times_since(first_task: str) -> str:
    """What a flight's times are counted from: the start of its first task, which need not be a take-off."""
    return "take-off" if first_task == "takeoff" else "the first task's start"
