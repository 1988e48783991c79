"""The page's HTTP server: a few small answers, each connection short, so that nobody can hold it up."""

import base64
import hashlib
import json
import re
import socket
import socketserver
import threading
import time
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from typing import Any

from mission.live.board import Board
from mission.live.gate import Refusal, has_token, refusal
from mission.live.settings import LiveSettings
from mission.operator import Wish

_READ_TIMEOUT_S = 5.0
_CONNECTION_LIMIT_S = 15.0
_MAX_CONNECTIONS = 32
_MAX_BODY_BYTES = 1024
_MAX_LINES = 60  # in a header, beside their frame; no line has more conductors
_COMMANDS = {f"/{wish}": wish for wish in Wish}


class LiveServer(ThreadingHTTPServer):
    """Serves the board that `board` holds under `lock`; `pass_on` takes a wish to the flight, and says if it could.

    A client that sends or takes nothing for 5 s, or needs more than 15 s in all, is cut off; one too many is not let
    in. Raises OSError when the address cannot be had.
    """

    daemon_threads = True
    block_on_close = False  # a stuck client must not hold up the end
    request_queue_size = 16

    def __init__(
        self, settings: LiveSettings, board: Board, lock: threading.Lock, pass_on: Callable[[Wish], bool]
    ) -> None:
        if ":" in settings.address:
            self.address_family = socket.AF_INET6
        self.settings = settings
        self.board = board
        self.lock = lock
        self.pass_on = pass_on
        self.page = resources.files("mission.live").joinpath("page.html").read_bytes()
        self.policy = _content_policy(self.page.decode())
        self._open: dict[socket.socket, float] = {}
        self._open_lock = threading.Lock()
        super().__init__((settings.address, settings.port), _Handler)

    def server_bind(self) -> None:
        """Bind without asking a name server who we are, as HTTPServer does: in the field there is none."""
        socketserver.TCPServer.server_bind(self)
        self.server_name, self.server_port = "", self.server_address[1]

    def process_request(self, request: Any, client_address: Any) -> None:
        """Let a client in, unless there are too many."""
        with self._open_lock:
            is_full = len(self._open) >= _MAX_CONNECTIONS
            if not is_full:
                self._open[request] = time.monotonic()
        if is_full:
            self.shutdown_request(request)
        else:
            super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        """A client has been answered, or goes."""
        with self._open_lock:
            self._open.pop(request, None)
        super().shutdown_request(request)

    def service_actions(self) -> None:
        """Cut off who takes too long."""
        now_s = time.monotonic()
        with self._open_lock:
            late = [request for request, since_s in self._open.items() if now_s - since_s > _CONNECTION_LIMIT_S]
        for request in late:
            try:
                request.shutdown(socket.SHUT_RDWR)  # its thread wakes up, and closes it
            except OSError:
                continue

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that went away in the middle is nobody's business."""


class _Handler(BaseHTTPRequestHandler):
    server: LiveServer
    server_version = "lineflight"
    sys_version = ""
    timeout = _READ_TIMEOUT_S

    def do_GET(self) -> None:
        """Answer with the page, or with what it asks for."""
        path = self.path.partition("?")[0]
        refused = refusal("GET", path, self.headers, self.server.settings)
        board = self.server.board
        if refused is not None:
            self._refuse(refused)
        elif path == "/":
            self._answer(200, "text/html; charset=utf-8", self.server.page)
        elif path == "/state":
            with self.server.lock:
                state = board.state(time.monotonic())
            # The page asks with the token that it has, which may be an older flight's.
            self._answer_json(200, state | {"may_command": has_token(self.headers, self.server.settings)})
        elif path == "/map":
            with self.server.lock:
                drawn = _json(board.map())
            self._answer(200, "application/json", drawn)
        elif path == "/frame.jpg" and (frame := board.frame) is not None:
            lines = ("X-Lines", json.dumps(frame.lines_px[:_MAX_LINES], separators=(",", ":")))
            self._answer(200, "image/jpeg", frame.jpeg, ("X-Seq", str(frame.seq)), lines)
        else:
            self._refuse(Refusal(404, "There is nothing here."))

    def do_POST(self) -> None:
        """Pass a wish on to the flight."""
        refused = refusal("POST", self.path, self.headers, self.server.settings)
        wish = _COMMANDS.get(self.path)
        if refused is None and wish is None:
            refused = Refusal(404, "There is no such command.")
        if refused is None:
            refused = self._read_body()
        if refused is None and self.server.board.ended is not None:
            refused = Refusal(409, "The flight has ended: nothing was sent.")
        if refused is not None or wish is None:
            self._refuse(refused or Refusal(404, "There is no such command."))
        elif self.server.pass_on(wish):
            self._answer_json(
                202, {"said": f"{wish.capitalize()} was passed on to the flight; its events say the rest."}
            )
        else:
            self._refuse(Refusal(503, "The flight's program does not listen: nothing was sent."))

    def _read_body(self) -> Refusal | None:
        """A command says all in its path: its body must be a small JSON object."""
        length = self.headers.get("Content-Length", "")
        if not re.fullmatch(r"\d{1,6}", length):
            return Refusal(411, "A command needs a Content-Length.")
        if int(length) > _MAX_BODY_BYTES:
            return Refusal(413, "That is too long for a command.")
        try:
            body = json.loads(self.rfile.read(int(length)))
        except ValueError:
            body = None
        return None if isinstance(body, dict) else Refusal(400, "A command is a JSON object.")

    def _refuse(self, refused: Refusal) -> None:
        self._answer_json(refused.status, {"said": refused.words})

    def _answer_json(self, status: int, answer: Any) -> None:
        self._answer(status, "application/json", _json(answer))

    def _answer(self, status: int, media_type: str, body: bytes, *more: tuple[str, str]) -> None:
        self.send_response(status)
        for name, value in (
            ("Content-Type", media_type),
            ("Content-Length", str(len(body))),
            ("Content-Security-Policy", self.server.policy),
            ("Cross-Origin-Resource-Policy", "same-origin"),
            ("X-Content-Type-Options", "nosniff"),
            ("X-Frame-Options", "DENY"),
            ("Referrer-Policy", "no-referrer"),
            ("Cache-Control", "no-store"),
            *more,
        ):
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002  # its name in the base class
        """Say nothing: the terminal is the flight's."""


def _json(answer: Any) -> bytes:
    return json.dumps(answer, allow_nan=False).encode()


def _content_policy(page: str) -> str:
    """Let the page run its own style and script, by their checksums, and talk to nobody but us."""

    def hashes(tag: str) -> str:
        parts = re.findall(rf"<{tag}>(.*?)</{tag}>", page, re.DOTALL)
        return " ".join(
            f"'sha256-{base64.b64encode(hashlib.sha256(part.encode()).digest()).decode()}'" for part in parts
        )

    return (
        f"default-src 'none'; script-src {hashes('script')}; style-src {hashes('style')}; connect-src 'self'; "
        "img-src blob: data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
