"""The live view's process: takes the flight's records in, serves them, and passes the operator's wishes back.

It is nobody's master: the flight never waits for it, and it ends when the flight hangs up, however suddenly.
"""

import contextlib
import os
import pickle
import signal
import threading
import time
from multiprocessing.connection import Connection

from mission.live.board import Board
from mission.live.settings import Batch, LiveSettings, Serving
from mission.live.web import LiveServer
from mission.log.live_stream import LiveStream
from mission.operator import Wish

WORDS = {Wish.HOLD: b"h", Wish.LAND: b"l"}
"""What goes back to the flight: one byte for each wish. Nothing that a network could reach is ever unpickled there."""

_LAST_WORD_S = 1.5  # a page that asks three times a second has seen the end by then
_WELCOME_PERIOD_S = 0.2
_NICENESS = 10  # vision and control go first


def serve(settings: LiveSettings, records: Connection, wishes: Connection) -> None:
    """Serve until `records` ends. The first thing that goes through `wishes` is a pickled Serving, then WORDS."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # they are for the flight, which wants to be watched until it has ended
    os.nice(_NICENESS)
    board, lock = Board(), threading.Lock()
    try:
        web = LiveServer(settings, board, lock, lambda wish: _pass_on(wishes, wish))
    except OSError as error:
        wishes.send(
            Serving(0, 0, _cannot("page", settings.address, settings.port, "--live-port or --live-address", error))
        )
        return
    stream_address = "127.0.0.1"
    try:
        stream = LiveStream(stream_address, settings.foxglove_port)
    except OSError as error:
        words = _cannot("stream for Foxglove", stream_address, settings.foxglove_port, "--live-foxglove-port", error)
        wishes.send(Serving(0, 0, words))
        return
    wishes.send(Serving(web.server_port, stream.port))
    os.set_blocking(wishes.fileno(), False)
    threading.Thread(target=web.serve_forever, name="page", daemon=True).start()
    with contextlib.suppress(EOFError, OSError):
        while True:
            if records.poll(_WELCOME_PERIOD_S):
                _take(records, board, lock, stream)
            stream.welcome()
    time.sleep(_LAST_WORD_S)
    stream.close()


def _take(records: Connection, board: Board, lock: threading.Lock, stream: LiveStream) -> None:
    batch = pickle.loads(records.recv_bytes())  # noqa: S301  # from the process that started us
    if not isinstance(batch, Batch):
        return
    with lock:
        board.add(batch, time.monotonic())
    for record in batch.records:
        # A record that a viewer's channel cannot take is missing there; the log says what is wrong with it.
        with contextlib.suppress(KeyError, ValueError, TypeError):
            stream.write(record)


def _pass_on(wishes: Connection, wish: Wish) -> bool:
    try:
        os.write(wishes.fileno(), WORDS[wish])
    except OSError:  # the flight has ended, or has not read for so long that the pipe is full
        return False
    return True


def _cannot(what: str, address: str, port: int, option: str, error: OSError) -> str:
    reason = error.strerror or str(error)
    return f"The live view's {what} cannot be served at {address}:{port} ({reason}); choose another with {option}."
