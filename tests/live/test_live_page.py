"""The page's server over real HTTP, in this process: what it answers, whom it refuses, whom it cuts off."""

import re
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest

from mission.live import web
from mission.live.board import Board
from mission.live.settings import Batch, Briefing, LiveSettings
from mission.live.web import LiveServer
from mission.operator import Wish
from mission.records import MissionEnded, Result
from tests.live.clients import ask, command, stuck
from tests.log.synthetic_flight import CAMERA, START_NS, see
from vision.records import VisionReport

REPORT: VisionReport = see(7, START_NS, (10.0, 0.0, -16.0, 1.5), has_image=True)


@dataclass
class Served:
    """A running server, and the wishes that it passed on."""

    port: int
    board: Board
    token: str
    wishes: list[Wish] = field(default_factory=list)
    is_listening: bool = True

    def pass_on(self, wish: Wish) -> bool:
        if self.is_listening:
            self.wishes.append(wish)
        return self.is_listening


@pytest.fixture
def served() -> Iterator[Served]:
    settings, board = LiveSettings(port=0), Board()
    told = Served(0, board, settings.token)
    server = LiveServer(settings, board, threading.Lock(), told.pass_on)
    told.port = server.server_port
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    yield told
    server.shutdown()
    thread.join()
    server.server_close()


def test_the_page_is_one_file_that_asks_nobody_else(served: Served) -> None:
    answer = ask(served.port, "/")
    page = answer.body.decode()
    assert answer.status == 200
    assert not re.search(r"https?://|//[\w.]+/|@import|url\(", page)
    assert not re.search(r"""\s(style|on\w+)=["']""", page)  # what the policy forbids would not work
    policy = answer.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert policy.count("'sha256-") == 2
    assert answer.headers["Set-Cookie"] is None
    assert served.token not in page


def test_state_map_and_frame_are_read_without_a_token(served: Served) -> None:
    assert ask(served.port, "/frame.jpg").status == 404
    served.board.add(Batch(0, (Briefing("short", ("takeoff",)), CAMERA, REPORT)), 0.0)
    assert ask(served.port, "/state").json["mission"] == "short"
    assert ask(served.port, "/map").json == {"track": [], "fixes": [], "true_line": []}
    frame = ask(served.port, "/frame.jpg")
    assert frame.body == REPORT.jpeg
    assert frame.headers["X-Seq"] == "7"
    assert ask(served.port, "/../secrets").status == 404


def test_the_state_says_whether_a_page_has_this_flights_token(served: Served) -> None:
    assert ask(served.port, "/state").json["may_command"] is False
    assert ask(served.port, "/state", Authorization="Bearer oldone").json["may_command"] is False
    assert ask(served.port, "/state", Authorization=f"Bearer {served.token}").json["may_command"] is True


def test_hold_and_land_are_passed_on(served: Served) -> None:
    assert command(served.port, "/hold", served.token).status == 202
    assert command(served.port, "/land", served.token, Origin=f"http://127.0.0.1:{served.port}").status == 202
    assert served.wishes == [Wish.HOLD, Wish.LAND]


@pytest.mark.parametrize(
    ("path", "changed", "status"),
    [
        ("/land", {"Authorization": ""}, 403),
        ("/land", {"Authorization": "Bearer wrong"}, 403),
        ("/land", {"Origin": "http://evil.example"}, 403),
        ("/land", {"Host": "evil.example"}, 403),
        ("/land", {"Sec_Fetch_Site": "cross-site"}, 403),
        ("/land", {"Content_Type": "text/plain"}, 415),
        ("/land", {"Content_Length": "100000"}, 413),
        ("/land", {"Content_Length": "-1"}, 411),
        ("/climb", {}, 404),
        ("/", {}, 404),
    ],
)
def test_any_other_command_does_nothing(served: Served, path: str, changed: dict[str, str], status: int) -> None:
    answer = command(served.port, path, served.token, **changed)
    assert answer.status == status
    assert answer.json["said"].endswith(".")
    assert served.wishes == []


def test_a_body_that_is_no_json_object_is_no_command(served: Served) -> None:
    headers = {"Authorization": f"Bearer {served.token}", "Content_Type": "application/json"}
    for body in ("", "no", "[]", "\xff"):
        assert ask(served.port, "/land", "POST", body, **headers).status == 400
    assert served.wishes == []


def test_after_the_flight_or_to_a_deaf_one_nothing_is_sent_and_that_is_said(served: Served) -> None:
    served.is_listening = False
    assert command(served.port, "/land", served.token).status == 503
    served.is_listening = True
    served.board.add(Batch(0, (MissionEnded(START_NS, Result.TAKEN_OVER, "the pilot has it"),)), 0.0)
    answer = command(served.port, "/land", served.token)
    assert answer.status == 409
    assert "nothing was sent" in answer.json["said"]
    assert served.wishes == []


def test_a_silent_client_is_cut_off(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(web._Handler, "timeout", 0.1)
    for words in (b"", b"GET /state HTT", b"POST /land HTTP/1.1\r\n"):
        client = stuck(served.port, words)
        assert client.recv(1) == b""
        client.close()


def test_a_client_that_dawdles_is_cut_off(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(web, "_CONNECTION_LIMIT_S", 0.3)
    client = stuck(served.port, b"GET /")
    client.settimeout(0.01)
    is_open = True
    while is_open:  # each letter comes in time, but there is no end of them
        try:
            client.sendall(b"x")
            is_open = client.recv(1) != b""
        except TimeoutError:
            continue
        except OSError:
            is_open = False
    client.close()


def test_one_client_too_many_is_not_let_in(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(web, "_MAX_CONNECTIONS", 3)
    clients = [stuck(served.port, b"GET / HTTP/1.1\r\n") for _ in range(3)]
    late = stuck(served.port, b"")
    assert late.recv(1) == b""
    for client in (*clients, late):
        client.close()
