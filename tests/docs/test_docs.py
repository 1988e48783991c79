"""The documents: no dead link, and tables that are the code's."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import get_args

import pytest

from mission.build import reactions
from mission.log import channels
from mission.plan import ParameterCheck, SafetyPlan
from mission.preflight_checks import check_all
from mission.safety import FIXED_REACTIONS, PRIORITY, Reaction
from sitl.world.file import shipped_worlds
from tests.docs.state_machine_page import PAGE, page
from tests.docs.streams_table import PAGE as LOG_PAGE
from tests.docs.streams_table import with_table
from tests.mission.test_preflight_checks import FINE, PLAN

ROOT = Path(__file__).parents[2]
DOCUMENTS = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda document: str(document.relative_to(ROOT)))
def test_relative_links_lead_somewhere(document: Path) -> None:
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)", document.read_text(encoding="utf-8"))
    assert [link for link in links if not (document.parent / link).exists()] == []


def test_the_safety_page_has_the_table_of_the_code() -> None:
    table, *_ = (ROOT / "docs/safety.md").read_text(encoding="utf-8").split("\n## ")
    rows = re.findall(r"^\| `(\w+)` \|.*\| ([\w ]+?)( \(mission\))? \|$", table, re.M)
    assert [row[0] for row in rows] == [str(hazard) for hazard in PRIORITY]
    defaults = reactions(SafetyPlan()) | FIXED_REACTIONS
    assert [Reaction(row[1].replace(" ", "_")) for row in rows] == [defaults[hazard] for hazard in PRIORITY]
    assert [bool(row[2]) for row in rows] == [hazard not in FIXED_REACTIONS for hazard in PRIORITY]


def test_the_readme_shows_the_shipped_mission() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = re.findall(r"^  - (\{task:[^}]+\})", readme, re.M)
    shipped = re.findall(r"^  - (\{task:[^}]+\})", (ROOT / "missions/follow_line.yaml").read_text(), re.M)
    assert shown == shipped


def test_the_preflight_page_names_every_check() -> None:
    names = re.findall(r"^\| `(\w+)` \|", (ROOT / "docs/preflight.md").read_text(), re.M)
    unread = [check.name for check in check_all(replace(FINE, parameters=None), PLAN)]
    place = unread.index("parameters") + 1
    assert names == [*unread[:place], *get_args(ParameterCheck), *unread[place:]]


def test_the_state_machine_is_drawn_from_the_code() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "run make diagram"


def test_the_page_on_the_log_has_the_streams_of_the_code() -> None:
    written = LOG_PAGE.read_text(encoding="utf-8")
    assert written == with_table(written), "run make streams-table"


def test_the_layout_for_foxglove_shows_streams_that_there_are() -> None:
    layout = json.loads((ROOT / "examples/foxglove-layout.json").read_text(encoding="utf-8"))
    fields = {c.topic: set(channels.json_schema(c.record)["properties"]) for c in channels.RECORD_CHANNELS}
    topics = {*fields, *(channel.topic for channel in channels.FOXGLOVE_CHANNELS)}
    text = json.dumps(layout["configById"])
    named = re.findall(r'"(/[a-z_/]+)((?:\.@?\w+)*)"', text)
    assert len(named) > 18
    for topic, path in named:
        assert topic in topics
        assert not path or path.split(".")[1] in fields[topic]
    assert sorted(re.findall(r'"(\w+!\w+)"', json.dumps(layout["layout"]))) == sorted(layout["configById"])


def test_the_page_on_worlds_shows_every_world_from_above_and_from_the_front() -> None:
    shown = re.findall(r"\]\(images/worlds/(\w+)_(down|front)\.jpg\)", (ROOT / "docs/worlds.md").read_text())
    assert {(world, camera) for world in shipped_worlds() for camera in ("down", "front")} <= set(shown)


def test_the_pictures_of_worlds_are_small() -> None:
    assert [file.name for file in ROOT.glob("docs/images/worlds/*") if file.stat().st_size >= 60_000] == []
