"""What a person who watches is told."""

import io

from rich.console import Console

from mission.checks import failed, passed, warning
from mission.watch import Watch
from tests.support.flights import shipped


def test_warnings_and_failures_of_preflight_are_printed_and_nothing_that_is_fine() -> None:
    out = io.StringIO()
    with Watch(shipped("follow_line"), Console(file=out, width=200)) as watch:
        watch.tell_checks([passed("clock", "12:00"), warning("disk", "make room soon"), failed("battery", "change it")])
    lines = [" ".join(line.split()) for line in out.getvalue().splitlines()]
    assert "warning disk: make room soon" in lines
    assert "failed battery: change it" in lines
    assert "12:00" not in out.getvalue()
