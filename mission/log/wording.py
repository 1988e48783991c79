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
            reaction = "" if record.reaction == "continue" else f" [{record.reaction}]"
            return "event", record.severity, f"{record.name}: {record.message}{reaction}"
        case PreflightCheck():
            return "preflight", _CHECK_SEVERITY[record.result], f"{words_of(record.name)}: {record.reason}"
        case TaskStarted():
            return "mission", Severity.INFO, f"{record.task} started"
        case TaskEnded():
            return "mission", severity_of(record.result), f"{record.task} {words_of(record.result)}: {record.reason}"
        case MissionEnded():
            return "mission", severity_of(record.result), f"mission {words_of(record.result)}: {record.reason}"
        case StatusText():
            return "autopilot", Severity.INFO, record.text
        case _ as unreachable:
            assert_never(unreachable)


def severity_of(result: Result) -> Severity:
    """How much a result matters."""
    return {Result.COMPLETED: Severity.INFO, Result.FAILED: Severity.ERROR}.get(result, Severity.WARNING)


def words_of(result: str) -> str:
    """Spell a result as people write it: taken_over becomes 'taken over'."""
    return result.replace("_", " ")
