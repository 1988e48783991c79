"""The options of the live view, shared by the commands that fly in real time."""

from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Annotated

import typer

from mission.ending import EXIT_BAD_INPUT, fail

if TYPE_CHECKING:
    from mission.live.feed import LiveFeed
    from mission.live.settings import LiveSettings

LiveOption = Annotated[
    bool, typer.Option("--live", help="Show the flight in a browser and in Foxglove while it goes on.")
]
LivePortOption = Annotated[
    int | None, typer.Option(min=1, max=65535, help="The live page's port; by default 8080.", show_default=False)
]
LiveAddressOption = Annotated[
    str | None,
    typer.Option(help="Serve the live page at this address, also to other computers; by default to this one alone."),
]
LiveFoxglovePortOption = Annotated[
    int | None, typer.Option(min=1, max=65535, help="The port for Foxglove, on this computer; by default 8765.")
]


def live_settings(
    live: bool, port: int | None, address: str | None, foxglove_port: int | None
) -> "LiveSettings | None":
    """What the options say; None without --live. Ends with a sentence where they contradict each other."""
    if not live:
        if (port, address, foxglove_port) != (None, None, None):
            fail("--live-port, --live-address and --live-foxglove-port belong to --live: add it.", EXIT_BAD_INPUT)
        return None
    from mission.live.settings import DEFAULT_ADDRESS, DEFAULT_FOXGLOVE_PORT, DEFAULT_PORT, LiveSettings

    return LiveSettings(address or DEFAULT_ADDRESS, port or DEFAULT_PORT, foxglove_port or DEFAULT_FOXGLOVE_PORT)


def serve_live(settings: "LiveSettings | None") -> "AbstractContextManager[LiveFeed | None]":
    """The live view, to be entered; entering it raises LiveError."""
    if settings is None:
        return nullcontext()
    from mission.live.feed import LiveFeed

    return LiveFeed(settings)


def tell_live(live: "LiveFeed", settings: "LiveSettings") -> None:
    """Print where to look. The token stands here alone."""
    typer.echo(f"live     {live.url}", err=True)
    typer.echo(f"foxglove ws://127.0.0.1:{live.serving.foxglove_port}", err=True)
    if not settings.is_local:
        typer.echo("The page is not encrypted: use it in a network that you trust, or through ssh -L.", err=True)
