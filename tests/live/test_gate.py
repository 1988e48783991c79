"""Who may read and who may command: every refusal, by itself."""

from email.message import Message
from ipaddress import IPv4Address

import pytest

from mission.live.gate import refusal
from mission.live.settings import LiveSettings

TOKEN = "the token"  # noqa: S105  # of nothing
HERE = LiveSettings(token=TOKEN)
FAR = LiveSettings(address="192.168.7.2", token=TOKEN)
HOST = "127.0.0.1:8080"
FROM_PAGE = {"Host": HOST, "Origin": f"http://{HOST}", "Sec-Fetch-Site": "same-origin"}
COMMAND = FROM_PAGE | {"Authorization": "Bearer the token", "Content-Type": "application/json"}
READS = ("/", "/state", "/map", "/frame.jpg")


def status(method: str, path: str, headers: dict[str, str], settings: LiveSettings = HERE) -> int | None:
    message = Message()
    for name, value in headers.items():
        message[name] = value
    refused = refusal(method, path, message, settings)
    assert refused is None or refused.words.endswith(".")
    return None if refused is None else refused.status


def test_the_page_with_its_token_may_command() -> None:
    assert status("POST", "/hold", COMMAND) is None
    assert status("POST", "/land", COMMAND | {"Content-Type": "Application/JSON; charset=utf-8"}) is None


@pytest.mark.parametrize(
    "authorization",
    [
        "",
        "Bearer",
        "Bearer ",
        "Bearer the toke",
        "Bearer the token ",
        "bearer the token",
        "Basic the token",
        "Bearer é",
    ],
)
def test_a_wrong_or_missing_token_commands_nothing(authorization: str) -> None:
    assert status("POST", "/land", COMMAND | {"Authorization": authorization}) == 403


def test_a_cookie_or_an_address_is_no_token() -> None:
    headers = {name: value for name, value in COMMAND.items() if name != "Authorization"}
    assert status("POST", "/land", headers | {"Cookie": "token=the token"}) == 403
    assert status("POST", "/land?token=the token", headers) == 403


@pytest.mark.parametrize("media_type", ["", "text/plain", "application/x-www-form-urlencoded", "multipart/form-data"])
def test_what_a_form_can_send_is_no_command(media_type: str) -> None:
    assert status("POST", "/land", COMMAND | {"Content-Type": media_type}) == 415


@pytest.mark.parametrize(
    "elsewhere",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:9999"},
        {"Origin": f"https://{HOST}"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
        {"Host": "evil.example:8080", "Origin": "http://evil.example:8080"},
        {"Host": "127.0.0.1.evil.example"},
        {"Host": ""},
    ],
)
def test_other_sites_neither_command_nor_read(elsewhere: dict[str, str]) -> None:
    assert status("POST", "/land", COMMAND | elsewhere) == 403
    assert [status("GET", path, FROM_PAGE | elsewhere) for path in READS] == [403] * len(READS)


@pytest.mark.parametrize("host", ["127.0.0.1:8080", "localhost:8080", "LOCALHOST", "[::1]:8080", "localhost:9000"])
def test_our_own_names_are_answered_also_through_a_tunnel(host: str) -> None:
    assert status("GET", "/state", {"Host": host}) is None
    assert status("POST", "/hold", COMMAND | {"Host": host, "Origin": f"http://{host}"}) is None


def test_on_this_computer_reading_needs_no_token_and_elsewhere_only_the_empty_page_does_not() -> None:
    assert [status("GET", path, {"Host": HOST}) for path in READS] == [None] * len(READS)
    host = {"Host": "192.168.7.2:8080"}
    assert [status("GET", path, host, FAR) for path in READS] == [None, 403, 403, 403]
    held = host | {"Authorization": "Bearer the token"}
    assert [status("GET", path, held, FAR) for path in READS] == [None] * len(READS)


@pytest.mark.parametrize(
    ("address", "is_local"),
    [("127.0.0.1", True), ("127.3.2.1", True), ("::1", True), ("localhost", True), (str(IPv4Address(0)), False),
     ("::", False), ("192.168.7.2", False), ("drone.local", False)],
)  # fmt: skip
def test_what_is_local(address: str, is_local: bool) -> None:
    assert LiveSettings(address=address).is_local is is_local


def test_each_flight_has_a_token_of_its_own_which_stands_in_the_fragment_alone() -> None:
    one, two = LiveSettings(), LiveSettings()
    assert one.token != two.token
    assert len(one.token) >= 32
    assert one.url(8080) == f"http://127.0.0.1:8080/#token={one.token}"
    assert one.token not in repr(one)
