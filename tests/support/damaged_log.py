"""Logs as a failing disk leaves them: some of their chunks damaged."""

from collections.abc import Callable
from pathlib import Path

from mcap.reader import make_reader
from mcap.records import Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import Writer

from drivers.mcap_stream import McapFile
from mission.log.copying import Copier


def damage_chunks(log: Path, out: Path, is_hit: Callable[[int, set[str]], bool]) -> int:
    """Copy a closed log, with a byte flipped in each chunk that `is_hit` by its number and its topics; say how many."""
    with log.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        file.seek(0)
        records = StreamReader(file, emit_chunks=True, record_size_limit=None).records
        chunks = [record for record in records if isinstance(record, Chunk)]
    topics = {channel.id: channel.topic for channel in summary.channels.values()}
    places = sorted((index.chunk_start_offset, index.chunk_length) for index in summary.chunk_indexes)
    data = bytearray(log.read_bytes())
    n_hit = 0
    for number, ((at, length), chunk) in enumerate(zip(places, chunks, strict=True)):
        if is_hit(number, {topics[one.channel_id] for one in breakup_chunk(chunk) if isinstance(one, Message)}):
            data[at + length // 2] ^= 1
            n_hit += 1
    out.write_bytes(data)
    return n_hit


def write_in_chunks(log: Path, out: Path, n_bytes: int) -> None:
    """Copy a log into small chunks."""
    with log.open("rb") as source, out.open("wb") as target:
        writer = Writer(target, chunk_size=n_bytes)
        copier = Copier(writer)
        for record in McapFile(source).records():
            copier.copy(record)
        writer.finish()
