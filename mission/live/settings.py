"""Where the live view is served, and what the flight's program and the live view's process say to each other."""

import ipaddress
import secrets
import socket
from dataclasses import dataclass, field

DEFAULT_ADDRESS = "127.0.0.1"
DEFAULT_PORT = 8080
DEFAULT_FOXGLOVE_PORT = 8765


class LiveError(Exception):
    """The live view cannot be served; the message is one sentence."""


@dataclass(frozen=True, slots=True)
class LiveSettings:
    """Where the page and the stream for Foxglove are served; port 0 takes any free one.

    The stream knows no token, so it stays on this computer whatever `address` is. `token` is the flight's own, and new
    for each: who has it may command.
    """

    address: str = DEFAULT_ADDRESS
    port: int = DEFAULT_PORT
    foxglove_port: int = DEFAULT_FOXGLOVE_PORT
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24), repr=False)

    @property
    def is_local(self) -> bool:
        """Whether only programs on this computer can reach the page."""
        if self.address == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.address).is_loopback
        except ValueError:
            return False

    def url(self, port: int) -> str:
        """The page's address with the token, which browsers keep to themselves (a fragment is never sent)."""
        host = socket.gethostname() if self.address in ("0.0.0.0", "::") else self.address  # noqa: S104  # no binding
        return f"http://{f'[{host}]' if ':' in host else host}:{port}/#token={self.token}"


@dataclass(frozen=True, slots=True)
class Serving:
    """What the live view's process says first: the ports it listens on, or in a sentence why it cannot."""

    port: int
    foxglove_port: int
    failure: str | None = None


@dataclass(frozen=True, slots=True)
class Briefing:
    """What is flown, for the page: the mission's name and its tasks in order."""

    mission: str
    tasks: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Batch:
    """Records on their way to the live view; `n_dropped` were given up so far, as it did not take them in time."""

    n_dropped: int
    records: tuple[object, ...]
