"""Copy a flight log whole, and lay further records into it: a new MCAP file."""

import json
import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from mcap.records import Attachment, Channel, Header, McapRecord, Message, Metadata, Schema
from mcap.writer import Writer

from drivers.mcap_stream import McapFile
from mission.log import channels
from mission.log.damage import METADATA, as_metadata, damage_of
from mission.log.errors import LogError

_TELL_PERIOD = 1_000  # records


class CopyError(Exception):
    """The new log cannot be written; the message is one sentence for a person."""


Change = Callable[[str, int, bytes], bytes | None]
"""(topic, log time [ns, Unix], message) -> the message that is written instead; None: none is."""


def unchanged(topic: str, log_time_ns: int, message: bytes) -> bytes | None:
    """Leave a message as it is."""
    return message


def write_copy(
    source: Path,
    out: Path,
    records: Iterable[tuple[int, object]],
    tell: Callable[[float], None],
    change: Change = unchanged,
) -> None:
    """Write `out`: every schema, channel, message, attachment and metadata of the log `source`, and `records` between.

    Messages go through `change` on their way. `records` are records of mission.log.channels with their log times [ns,
    Unix], in the order of these. `tell` hears how much of `source` has been read, 0 to 1. What stands under `out` is
    whole: it is written under another name first. What is damaged in `source` is not copied, and the copy says so.
    Raises CopyError when it exists or cannot be written, LogError when `source` cannot be read.
    """
    if out.exists():
        raise CopyError(f"{out} exists already; name another file, or remove it.")
    part = out.with_name(out.name + ".part")
    try:
        with part.open("xb") as file:
            try:
                _copy(_records(source, tell), Writer(file), iter(records), change)
                file.flush()
                os.fsync(file.fileno())
                part.rename(out)
            finally:
                part.unlink(missing_ok=True)  # it has been renamed, or is not whole
    except FileExistsError as error:
        raise CopyError(f"{part} is in the way, which an import left or still writes; remove it first.") from error
    except OSError as error:
        raise CopyError(
            f"The log {out} cannot be written ({error.strerror or error}); name a place with room."
        ) from error


def _records(source: Path, tell: Callable[[float], None]) -> Iterator[McapRecord]:
    """Every record of a log, and at its end what of it is damaged; raises LogError."""
    try:
        with source.open("rb") as file:
            n_bytes = max(source.stat().st_size, 1)
            log = McapFile(file)
            for index, record in enumerate(log.records()):
                if index % _TELL_PERIOD == 0:
                    tell(file.tell() / n_bytes)
                if not (isinstance(record, Metadata) and record.name == METADATA):
                    yield record
            damage = damage_of(log)
            if damage is not None:
                yield Metadata(METADATA, as_metadata(damage))
    except OSError as error:
        raise LogError(f"The log {source} cannot be read ({error.strerror}); is its disk still there?") from error


def _copy(
    originals: Iterator[McapRecord], writer: Writer, records: Iterator[tuple[int, object]], change: Change
) -> None:
    copier = Copier(writer)
    added = _Added(writer)
    waiting = next(records, None)
    for record in originals:
        while waiting is not None and isinstance(record, Message) and waiting[0] <= record.log_time:
            added.write(*waiting)
            waiting = next(records, None)
        copier.copy(record, change)
    while waiting is not None:
        added.write(*waiting)
        waiting = next(records, None)
    writer.finish()


class Copier:
    """Copies a log's records, header first, through a writer that is not started yet.

    What a log says once is copied once: a closed log repeats its schemas and channels, and a log may be copied again
    behind itself.
    """

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._schema_ids = {0: 0}  # 0: a channel without a schema
        self._channel_ids: dict[int, int] = {}
        self._topics: dict[int, str] = {}
        self._said: set[tuple[type, str]] = set()

    def copy(self, record: McapRecord, change: Change = unchanged, later_ns: int = 0) -> None:
        """Copy a record; a message goes through `change`, and stands `later_ns` later in the new log."""
        writer = self._writer
        if isinstance(record, Message):
            data = change(self._topics[record.channel_id], record.log_time, record.data)
            if data is not None:
                writer.add_message(
                    self._channel_ids[record.channel_id],
                    record.log_time + later_ns,
                    data,
                    record.publish_time + later_ns,
                    record.sequence,
                )
        elif isinstance(record, Schema):
            if record.id not in self._schema_ids:
                self._schema_ids[record.id] = writer.register_schema(record.name, record.encoding, record.data)
        elif isinstance(record, Channel):
            if record.id not in self._channel_ids:
                self._topics[record.id] = record.topic
                schema_id = self._schema_ids.get(record.schema_id, 0)  # it may have stood in a damaged part
                self._channel_ids[record.id] = writer.register_channel(
                    record.topic, record.message_encoding, schema_id, record.metadata
                )
        elif self._is_new(record):
            if isinstance(record, Header):
                writer.start(record.profile, record.library)
            elif isinstance(record, Attachment):
                writer.add_attachment(record.create_time, record.log_time, record.name, record.media_type, record.data)
            elif isinstance(record, Metadata):
                writer.add_metadata(record.name, record.metadata)

    def _is_new(self, record: McapRecord) -> bool:
        key = type(record), getattr(record, "name", "")
        is_new = key not in self._said
        self._said.add(key)
        return is_new


class _Added:
    """Writes records of mission.log.channels; makes each one's channel when its first record comes."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._channel_ids: dict[type, int] = {}

    def write(self, log_time_ns: int, record: object) -> None:
        kind = type(record)
        if kind not in self._channel_ids:
            self._channel_ids[kind] = self._register(kind)
        self._writer.add_message(self._channel_ids[kind], log_time_ns, channels.encode(record), log_time_ns)

    def _register(self, kind: type) -> int:
        channel = channels.CHANNEL_OF[kind]
        schema = json.dumps(channels.json_schema(kind)).encode()
        schema_id = self._writer.register_schema(f"lineflight.{kind.__name__}", "jsonschema", schema)
        about = {"what": channel.what, "rate": channel.rate}
        return int(self._writer.register_channel(channel.topic, "json", schema_id, about))
