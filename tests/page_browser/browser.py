"""Chromium without a window, driven over a pipe by its DevTools protocol (https://chromedevtools.github.io)."""

import base64
import contextlib
import fcntl
import json
import os
import select
import shutil
import signal
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Self

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
_ANSWER_LIMIT_S = 60.0
_FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--remote-debugging-pipe",
    "--enable-unsafe-swiftshader",
    "--hide-scrollbars",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
)


def find_chromium() -> str | None:
    """The browser's program; None where there is none."""
    return next((path for name in PROGRAMS if (path := shutil.which(name)) is not None), None)


class _Navigated(RuntimeError):
    """The page went while it was asked."""


@dataclass
class Page:
    """What was heard of an open page: addresses asked for, console errors and uncaught exceptions."""

    requests: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)


class Browser:
    """A context manager; one page at a time."""

    def __init__(self, width_px: int, height_px: int, *, is_dark: bool = False) -> None:
        self._size = (width_px, height_px)
        self._is_dark = is_dark
        self._n_sent = 0
        self._buffer = b""
        self._session: str | None = None
        self.page = Page()

    def __enter__(self) -> Self:
        program = find_chromium()
        if program is None:
            raise RuntimeError("there is no Chromium here: run `make test-page`, which installs it from Debian")
        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self._pid = self._spawn(program)
        try:
            self._attach()
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()

    def _spawn(self, program: str) -> int:
        """Start it with the protocol's pipe at the descriptors where it is wanted: 3 and 4."""
        to_read, self._to = os.pipe()
        self._from, to_write = os.pipe()
        flags = [*_FLAGS, f"--user-data-dir={self._profile.name}", "--window-size={},{}".format(*self._size)]
        nowhere = os.open(os.devnull, os.O_RDWR)
        # Through higher numbers, so that neither end is overwritten before it is moved.
        high = [fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, 50) for descriptor in (to_read, to_write)]
        moves = [(nowhere, 0), (nowhere, 1), (nowhere, 2), (high[0], 3), (high[1], 4)]
        pid = os.posix_spawn(
            program,
            [program, *flags, "about:blank"],
            os.environ,
            file_actions=[(os.POSIX_SPAWN_DUP2, source, target) for source, target in moves],
        )
        for descriptor in (to_read, to_write, nowhere, *high):
            os.close(descriptor)
        return pid

    def _end(self) -> None:
        os.kill(self._pid, signal.SIGKILL)
        os.waitpid(self._pid, 0)
        os.close(self._to)
        os.close(self._from)
        self._profile.cleanup()

    def _attach(self) -> None:
        targets = self.send("Target.getTargets")["targetInfos"]
        target = next(info["targetId"] for info in targets if info["type"] == "page")
        self._session = self.send("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Network", "Runtime", "Log", "Page"):
            self.send(f"{domain}.enable")
        width_px, height_px = self._size
        self.send(
            "Emulation.setDeviceMetricsOverride", width=width_px, height=height_px, deviceScaleFactor=1, mobile=False
        )
        scheme = "dark" if self._is_dark else "light"
        self.send("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def open(self, file: Path) -> None:
        """Open a file and wait until its script has drawn."""
        self.go(file.resolve().as_uri())
        self.wait_for("document.body && document.body.dataset.ready === 'yes'")

    def go(self, url: str) -> None:
        """Go to an address; waits for nothing."""
        self.page = Page()
        self.send("Page.navigate", url=url)

    def wait_for(self, expression: str) -> None:
        """Wait until an expression is true, on this page or on the one that it goes to."""
        limit_s = time.monotonic() + _ANSWER_LIMIT_S
        is_true = False
        while not is_true:
            with contextlib.suppress(_Navigated):
                is_true = bool(self.evaluate(expression))
            if not is_true and time.monotonic() > limit_s:
                raise TimeoutError(f"{expression} did not come true; errors: {self.page.errors}")

    def evaluate(self, expression: str) -> Any:
        """What an expression gives, a promise's result included."""
        answer = self.send("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(f"{expression}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def screenshot(self, file: Path) -> None:
        """Take a picture of what the window shows."""
        file.write_bytes(base64.b64decode(self.send("Page.captureScreenshot", format="png")["data"]))

    def send(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command and wait for its answer; what happens meanwhile is noted."""
        self._n_sent += 1
        message: dict[str, Any] = {"id": self._n_sent, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        limit_s = time.monotonic() + _ANSWER_LIMIT_S
        while True:
            heard = self._hear(limit_s)
            if heard.get("id") == self._n_sent:
                if "error" in heard:
                    if "navigated" in heard["error"]["message"]:
                        raise _Navigated(method)
                    raise RuntimeError(f"{method}: {heard['error']}")
                result: dict[str, Any] = heard["result"]
                return result
            self._note(heard)

    def _hear(self, limit_s: float) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._from], [], [], max(0.0, limit_s - time.monotonic()))
            piece = os.read(self._from, 1 << 20) if ready else b""
            if not piece:
                raise TimeoutError("Chromium does not answer")
            self._buffer += piece
        text, self._buffer = self._buffer.split(b"\0", 1)
        heard: dict[str, Any] = json.loads(text)
        return heard

    def _note(self, heard: dict[str, Any]) -> None:
        method, parameters = heard.get("method"), heard.get("params", {})
        if method == "Network.requestWillBeSent":
            self.page.requests.append(parameters["request"]["url"])
        elif method == "Runtime.exceptionThrown":
            self.page.errors.append(json.dumps(parameters["exceptionDetails"])[:500])
        elif method == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "assert"):
            self.page.errors.append(json.dumps(parameters["args"])[:500])
        elif method == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            self.page.errors.append(parameters["entry"]["text"])
