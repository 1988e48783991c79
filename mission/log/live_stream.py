"""A flight as it goes on, for Foxglove: an encoder's channels behind a WebSocket server."""

import queue

import foxglove
from foxglove.websocket import ChannelView, Client, ServerListener

from mission.log.encoding import Encoder
from mission.log.records import LoggedMission

_BACKLOG = 256  # messages for each viewer: what a slow one does not take in time is dropped


class LiveStream:
    """The same channels for viewers: a WebSocket server that Foxglove connects to; it takes nothing from them.

    It serves from threads of its own and drops what a slow viewer does not take. Raises OSError, in words for people,
    when it cannot be opened. `port` 0 takes any free one.
    """

    def __init__(self, address: str, port: int) -> None:
        self._context = foxglove.Context()
        self._newcomers: queue.SimpleQueue[str] = queue.SimpleQueue()
        foxglove.set_log_level("CRITICAL")  # a viewer that goes without a word is nobody's business
        try:
            self._server = foxglove.start_server(
                name="lineflight",
                host=address,
                port=port,
                server_listener=_Newcomers(self._newcomers),
                context=self._context,
                message_backlog_size=_BACKLOG,
            )
        except RuntimeError as error:
            raise OSError(str(error)) from None
        self._encoder: Encoder | None = None

    @property
    def port(self) -> int:
        """The port that it listens on."""
        return int(self._server.port)

    def write(self, record: object) -> None:
        """Send a record to whoever watches. What comes before the flight's LoggedMission is not sent, nor are files."""
        if isinstance(record, LoggedMission):
            self._encoder = Encoder(self._context, record)
        if self._encoder is not None and self._encoder.knows(record):
            self._encoder.write(record)

    def welcome(self) -> None:
        """Tell those who came since the last call what was said once and for all."""
        while not self._newcomers.empty():
            topic = self._newcomers.get()
            if self._encoder is not None:
                self._encoder.repeat(topic)

    def close(self) -> None:
        """Serve no more."""
        self._server.stop()


class _Newcomers(ServerListener):  # type: ignore[misc]  # foxglove is untyped here
    """Keeps which topics somebody has just begun to listen to."""

    def __init__(self, topics: "queue.SimpleQueue[str]") -> None:
        self._topics = topics

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        """Somebody begins to listen; called by a thread of the server."""
        self._topics.put(channel.topic)
