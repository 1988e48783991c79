"""The live view's process, fed as by a flight: it shows, it passes wishes on, and it never holds the flight up."""

import contextlib
import os
import signal
import socket
from collections.abc import Iterator

import pytest

from drivers.clock import NS_PER_S
from mission.live.feed import LiveFeed
from mission.live.settings import Briefing, LiveError, LiveSettings
from mission.log.channels import FOXGLOVE_CHANNELS, RECORD_CHANNELS
from mission.log.records import LoggedMission, StatusText
from mission.operator import Wish
from tests.live.clients import FoxgloveClient, ask, command, stuck, until
from tests.log.synthetic_flight import CAMERA, LINE, MISSION_TEXT, ORIGIN, START_NS, see

pytestmark = pytest.mark.real_time

MISSION = LoggedMission("follow_line", MISSION_TEXT, "", START_NS, 0, {})
REPORT = see(7, START_NS, (10.0, 0.0, -16.0, 1.5), has_image=True)
FREE = LiveSettings(port=0, foxglove_port=0)


@pytest.fixture
def feed() -> Iterator[LiveFeed]:
    with LiveFeed(LiveSettings(port=0, foxglove_port=0)) as feed:
        for record in (Briefing("follow_line", ("takeoff", "land")), MISSION, CAMERA, ORIGIN, LINE, REPORT):
            feed.record(record)
        yield feed


def newest(feed: LiveFeed) -> str | None:
    events = ask(feed.serving.port, "/state").json["events"]
    return events[-1]["text"] if events else None


def say(feed: LiveFeed, text: str) -> None:
    feed.record_status_text(START_NS + NS_PER_S, text)


def test_what_the_flight_records_is_shown(feed: LiveFeed) -> None:
    port = feed.serving.port
    state = until(lambda: (state := ask(port, "/state").json)["frame"] and state)
    assert state["mission"] == "follow_line"
    assert state["frame"]["seq"] == REPORT.seq
    assert ask(port, "/frame.jpg").body == REPORT.jpeg
    assert len(ask(port, "/map").json["true_line"]) == 2
    assert feed.url.startswith(f"http://127.0.0.1:{port}/#token=")


def test_wishes_come_back_and_nothing_else_does(feed: LiveFeed) -> None:
    port, token = feed.serving.port, feed.url.partition("#token=")[2]
    assert feed.wishes() == []
    assert command(port, "/land", "guessed").status == 403
    assert command(port, "/hold", token).status == 202
    assert command(port, "/land", token).status == 202
    assert until(feed.wishes) == [Wish.HOLD, Wish.LAND]
    assert feed.wishes() == []
    assert feed.failure is None


def test_stuck_clients_hold_up_neither_the_feed_nor_others(feed: LiveFeed) -> None:
    port = feed.serving.port
    until(lambda: ask(port, "/state").json["frame"])
    words = (b"", b"GET / HTTP/1.1\r\n", b"GET /frame.jpg HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
    clients = [stuck(port, words[index % 3]) for index in range(15)]
    clients += [stuck(feed.serving.foxglove_port, b"GET / HTTP/1.1\r\n") for _ in range(5)]
    for index in range(1000):
        say(feed, f"word {index}")
    until(lambda: newest(feed) == "word 999")
    assert feed.n_dropped == 0
    for client in clients:
        client.close()


def test_a_stopped_process_is_fed_without_waiting_and_comes_back(feed: LiveFeed) -> None:
    until(lambda: ask(feed.serving.port, "/state").json["frame"])
    assert feed.pid is not None
    os.kill(feed.pid, signal.SIGSTOP)
    for index in range(50_000):  # more than any pipe and backlog hold: who waited would wait for ever
        feed.record(REPORT if index % 10 == 0 else StatusText(START_NS, "x" * 100))
    assert feed.n_dropped > 0
    assert feed.wishes() == []
    os.kill(feed.pid, signal.SIGCONT)
    until(lambda: say(feed, "back again") or newest(feed) == "back again")
    assert ask(feed.serving.port, "/state").json["n_dropped"] > 0
    assert feed.failure is None


def test_the_end_does_not_wait_for_a_stopped_process() -> None:
    with LiveFeed(FREE) as feed:
        assert feed.pid is not None
        os.kill(feed.pid, signal.SIGSTOP)
        for _ in range(5000):
            feed.record(REPORT)
    with pytest.raises(ProcessLookupError):
        os.kill(feed.pid, 0)


def test_a_process_that_died_is_told_and_changes_nothing(feed: LiveFeed) -> None:
    assert feed.pid is not None
    os.kill(feed.pid, signal.SIGKILL)
    until(lambda: feed.wishes() or feed.failure)
    assert "the flight goes on" in str(feed.failure)
    for index in range(5000):
        say(feed, f"word {index}")
    assert feed.wishes() == []


def test_ctrl_c_does_not_end_it(feed: LiveFeed) -> None:
    assert feed.pid is not None
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        os.kill(feed.pid, number)
    say(feed, "still here")
    until(lambda: newest(feed) == "still here")


@pytest.mark.parametrize(("option", "words"), [("port", "--live-port"), ("foxglove_port", "--live-foxglove-port")])
def test_a_port_that_is_taken_is_said_before_anything_flies(option: str, words: str) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        ports = {"port": 0, "foxglove_port": 0, option: taken.getsockname()[1]}
        with pytest.raises(LiveError, match=words), LiveFeed(LiveSettings(**ports)):  # type: ignore[arg-type]
            raise AssertionError("it was entered")


def test_foxglove_has_the_logs_channels_and_latecomers_hear_what_was_said_once(feed: LiveFeed) -> None:
    until(lambda: ask(feed.serving.port, "/state").json["frame"])
    with contextlib.closing(FoxgloveClient(feed.serving.foxglove_port)) as client:
        topics = {channel.topic for channel in (*RECORD_CHANNELS, *FOXGLOVE_CHANNELS)}
        channels = client.channels(topics)
        assert set(channels) == topics
        client.say({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": channels["/mission"]}]})
        heard = client.hear()
        while not heard.startswith(b"\x01"):  # a message's data
            heard = client.hear()
        assert b"follow_line" in heard
