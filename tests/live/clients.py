"""Clients of the live view: over HTTP, over the WebSocket, and one that is stuck."""

import base64
import http.client
import json
import os
import socket
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

DEADLINE_S = 60.0


@dataclass(frozen=True)
class Answer:
    status: int
    headers: http.client.HTTPMessage
    body: bytes

    @property
    def json(self) -> Any:
        return json.loads(self.body)


def ask(port: int, path: str, method: str = "GET", body: str | None = None, **headers: str) -> Answer:
    """Ask, with headers in which underscores stand for dashes."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=DEADLINE_S)
    try:
        connection.request(method, path, body, {name.replace("_", "-"): value for name, value in headers.items()})
        answer = connection.getresponse()
        return Answer(answer.status, answer.headers, answer.read())
    finally:
        connection.close()


def command(port: int, path: str, token: str, **headers: str) -> Answer:
    """Command as the page does."""
    wanted = {"Authorization": f"Bearer {token}", "Content_Type": "application/json"} | headers
    return ask(port, path, "POST", "{}", **{name: value for name, value in wanted.items() if value})


def until(holds: Callable[[], Any]) -> Any:
    """Wait for something to become true, and return it."""
    deadline_s = time.monotonic() + DEADLINE_S
    while not (value := holds()):
        assert time.monotonic() < deadline_s, "it never happened"
    return value


def stuck(port: int, words: bytes) -> socket.socket:
    """A client that says something and never reads what it is answered."""
    client = socket.socket()
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1024)
    client.settimeout(DEADLINE_S)
    client.connect(("127.0.0.1", port))
    client.sendall(words)
    return client


class FoxgloveClient:
    """Enough of a WebSocket (RFC 6455) and of Foxglove's protocol to hear what is advertised, and what comes."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=DEADLINE_S)
        key = base64.b64encode(os.urandom(16)).decode()
        self._socket.sendall(
            f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n".encode()
        )
        self._file = self._socket.makefile("rb")
        assert b"101" in self._file.readline()
        while self._file.readline().strip():
            pass

    def hear(self) -> bytes:
        """The next message's payload."""
        _, length = self._file.read(2)
        if length == 126:
            (length,) = struct.unpack(">H", self._file.read(2))
        elif length == 127:
            (length,) = struct.unpack(">Q", self._file.read(8))
        return self._file.read(length)

    def say(self, message: Any) -> None:
        """Send JSON, masked by zeros as a client must."""
        body = json.dumps(message).encode()
        self._socket.sendall(struct.pack(">BBH4x", 0x81, 0x80 | 126, len(body)) + body)

    def channels(self, topics: set[str]) -> dict[str, int]:
        """Topics and channel ids, as advertised in the next messages; waits until all `topics` are among them."""
        found: dict[str, int] = {}
        while not topics <= set(found):
            heard = json.loads(self.hear())
            if heard["op"] == "advertise":
                found |= {channel["topic"]: channel["id"] for channel in heard["channels"]}
        return found

    def close(self) -> None:
        self._file.close()
        self._socket.close()
