"""What a pre-flight check says: its name, its result, and a reason that a person can act on."""

from dataclasses import dataclass

from mission.records import CheckResult


@dataclass(frozen=True, slots=True)
class Check:
    """One check; `waits_for` names what a failed one still waits for, and is empty where waiting mends nothing."""

    name: str
    result: CheckResult
    reason: str
    waits_for: str = ""

    @property
    def line(self) -> str:
        """The check as people read it."""
        return f"{self.name.replace('_', ' ')}: {self.reason}"

    @property
    def is_final(self) -> bool:
        """Whether it failed, and will not pass by waiting."""
        return self.result is CheckResult.FAILED and not self.waits_for


def passed(name: str, reason: str) -> Check:
    """A check that is fine."""
    return Check(name, CheckResult.OK, reason)


def warning(name: str, reason: str) -> Check:
    """A check that a person should hear of; the vehicle may fly."""
    return Check(name, CheckResult.WARNING, reason)


def failed(name: str, reason: str) -> Check:
    """A check that keeps the vehicle on the ground until somebody does something about it."""
    return Check(name, CheckResult.FAILED, reason)


def waiting(name: str, what: str) -> Check:
    """A check that keeps the vehicle on the ground until `what` is there."""
    return Check(name, CheckResult.FAILED, f"waiting for {what}", what)
