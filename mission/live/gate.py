"""Who may read the live view, and who may command: one pure decision for each request.

The page is plain HTTP, so the browser is what has to be kept honest. A page from elsewhere must neither read nor
command (Origin, Sec-Fetch-Site), a name that an attacker points at this computer must not count as ours (Host, against
DNS rebinding), and only who was given the flight's token may command. There are no cookies that a browser could add by
itself.
"""

import hmac
import ipaddress
import socket
from dataclasses import dataclass
from email.message import Message

from mission.live.settings import LiveSettings


@dataclass(frozen=True, slots=True)
class Refusal:
    """An HTTP status and a sentence."""

    status: int
    words: str


def refusal(method: str, path: str, headers: Message, settings: LiveSettings) -> Refusal | None:
    """Why a request is not answered; None where it may be."""
    host = headers.get("Host", "")
    if not _is_our_name(host, settings):
        return Refusal(403, "Open this page by the computer's address.")
    origin = headers.get("Origin")
    if (origin is not None and origin != f"http://{host}") or headers.get("Sec-Fetch-Site", "none") not in (
        "same-origin",
        "none",
    ):
        return Refusal(403, "Other pages have no business here.")
    is_command = method == "POST"
    needs_token = is_command or not (path == "/" or settings.is_local)
    if needs_token and not has_token(headers, settings):
        return Refusal(403, "The token is missing or wrong: use the address that the flight printed.")
    if is_command and headers.get("Content-Type", "").partition(";")[0].strip().lower() != "application/json":
        return Refusal(415, "A command comes as application/json.")
    return None


def has_token(headers: Message, settings: LiveSettings) -> bool:
    """Whether a request comes with this flight's token, and so may command."""
    authorization = headers.get("Authorization", "")
    # In constant time, so that nobody can find it out letter by letter.
    return hmac.compare_digest(authorization.encode("utf-8", "replace"), f"Bearer {settings.token}".encode())


def _is_our_name(host: str, settings: LiveSettings) -> bool:
    """Whether a Host header names this computer: an address, or a name of its own.

    Any address will do: what an attacker can point at us is a name.
    """
    name = host[1:].partition("]")[0] if host.startswith("[") else host.partition(":")[0]
    here = socket.gethostname().lower()
    if name.lower() in ("localhost", settings.address.lower(), here, f"{here}.local"):
        return True
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
