"""The comparison of a replay with a golden record finds what differs."""

import copy
from pathlib import Path
from typing import Any

import pytest

from tests.sitl.comparison import differences
from tests.sitl.replay import Replay, load, play_px4

RECORD = load(Path(__file__).parent / "golden" / "px4" / "d_armdeny_boot.json")


@pytest.fixture(scope="module")
def replay() -> Replay:
    return play_px4(RECORD)


def changed(stream: str, place: int, *what: Any) -> dict[str, Any]:
    """The record with another answer at a place of a stream; without one when nothing is given."""
    record = copy.deepcopy(RECORD)
    if what:
        record[stream][place] = list(what)
    else:
        del record[stream][place]
    return record


def test_what_agrees_differs_in_nothing(replay: Replay) -> None:
    assert differences(RECORD, replay, {}) == []


@pytest.mark.parametrize("stream", ["ack", "message_ack", "text", "heartbeat"])
def test_a_missing_answer_is_found(replay: Replay, stream: str) -> None:
    found = differences(changed(stream, 0), replay, {})
    assert found[0].startswith(f"--- {stream}")
    assert any(line.startswith("->") for line in found)


def test_another_value_is_found(replay: Replay) -> None:
    at_s, station, command, result = RECORD["ack"][0]
    found = differences(changed("ack", 0, at_s, station, command, result + 1), replay, {})
    assert {line[:2] for line in found} >= {"->", "<-"}


def test_another_order_is_found(replay: Replay) -> None:
    record = copy.deepcopy(RECORD)
    first, last = record["ack"][3], record["ack"][4]
    record["ack"][3], record["ack"][4] = [first[0], *last[1:]], [last[0], *first[1:]]
    assert differences(record, replay, {})


def test_another_time_is_found(replay: Replay) -> None:
    at_s, *what = RECORD["text"][0]
    assert differences(changed("text", 0, at_s + 0.4, *what), replay, {}) == []
    assert any(line.startswith("!!") for line in differences(changed("text", 0, at_s - 0.6, *what), replay, {}))


def test_an_exception_hides_what_it_names(replay: Replay) -> None:
    assert differences(changed("text", 0), replay, {"text 2 Arming denied": "because"}) == []
    assert differences(changed("text", 0), replay, {"text 2 Something": "because"})


def test_a_wait_in_vain_is_told() -> None:
    record = copy.deepcopy(RECORD)
    record["inputs"], record["end_s"] = [[1.0, "wait", "landed", [3]]], 20.0
    assert differences(record, play_px4(record), {})[0] == "waited in vain for landed [3], recorded at 1.0 s"
