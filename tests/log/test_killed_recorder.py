"""A program that is killed at any moment leaves a log that opens, and has lost at most the last two seconds."""

import os
import random
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Chunk, Message
from mcap.stream_reader import StreamReader

from drivers.clock import NS_PER_S
from mission.log.reader import read_flight
from tests.log import synthetic_flight
from tests.log.synthetic_flight import START_NS, fly, write_log

N_KILLS = 30
AT_ONCE = 5
LOST_S = 2.0

# Records the synthetic flight at its own pace, and says after each what it has handed to the recorder.
WRITER = """
import os, sys, time
from pathlib import Path
from tests.log.synthetic_flight import *
recorder = Recorder(Path(sys.argv[1]), mission_text=MISSION_TEXT, mission_name="m", metadata={}, clock=FixedClock())
recorder.__enter__()
began_s = time.monotonic()
for t_ns, item in fly(image_period_s=0.25):
    time.sleep(max(0.0, began_s + (t_ns - START_NS) / 1e9 - time.monotonic()))
    put_down(recorder, t_ns, item)
    os.write(1, t_ns.to_bytes(8, "little"))
"""


@pytest.mark.real_time
def test_killed_at_thirty_moments_every_log_opens_and_lacks_two_seconds_at_most(tmp_path: Path) -> None:
    draw = random.Random("kills")
    kills = [(tmp_path / f"{k}.mcap", draw.uniform(0.0, 4.0) if k else 0.0) for k in range(N_KILLS)]
    with ThreadPoolExecutor(AT_ONCE) as pool:
        handed_ns = list(pool.map(lambda kill: write_and_kill(*kill), kills))
    for (path, _), last_ns in zip(kills, handed_ns, strict=True):
        flight = read_flight(path, with_images=True)
        assert flight.is_truncated
        newest_ns = flight.states[-1].t_ns if flight.states else START_NS
        assert newest_ns >= last_ns - LOST_S * NS_PER_S
        assert check_records(path) > 0


def write_and_kill(path: Path, delay_s: float) -> int:
    """Kill a writer so long after its first record; returns the time of the last record that it handed over [ns]."""
    environment = {**os.environ, "PYTHONPATH": str(Path(synthetic_flight.__file__).parents[2])}
    command = [sys.executable, "-c", WRITER, str(path)]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE) as writer:
        assert writer.stdout is not None
        first = writer.stdout.read(8)
        time.sleep(delay_s)
        writer.kill()
        rest = writer.stdout.read()
    whole = first + rest[: len(rest) // 8 * 8]
    assert whole, "the writer never began"
    return int.from_bytes(whole[-8:], "little")


def check_records(path: Path) -> int:
    """Read a log by the mcap package, each chunk against its checksum; returns the number of messages."""
    n_messages = 0
    with path.open("rb") as file:
        try:
            for record in StreamReader(file, validate_crcs=True, record_size_limit=None).records:
                n_messages += isinstance(record, Message)
        except EndOfFile:
            pass  # it was never closed
        except Exception as error:
            # The record that was being written is cut off.
            assert file.read(1) == b"", f"{error} in the middle of {path}"  # noqa: PT017
    return n_messages


def test_a_closed_log_is_sound_through_and_through(tmp_path: Path) -> None:
    """What `mcap doctor` looks at: checksums, the index, the statistics, and the order of times within a topic."""
    path = tmp_path / "whole.mcap"
    assert write_log(path, list(fly())).failure is None
    with path.open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
        assert summary is not None
        assert summary.statistics is not None
        file.seek(0)
        records = list(StreamReader(file, emit_chunks=True, validate_crcs=True, record_size_limit=None).records)
        assert sum(isinstance(record, Chunk) for record in records) == summary.statistics.chunk_count
        assert len(summary.chunk_indexes) == summary.statistics.chunk_count
        file.seek(0)
        counts = dict.fromkeys(summary.channels, 0)
        newest = dict.fromkeys(summary.channels, 0)
        for _, channel, message in make_reader(file, validate_crcs=True).iter_messages(log_time_order=False):
            counts[channel.id] += 1
            assert message.log_time >= newest[channel.id]
            newest[channel.id] = message.log_time
        assert counts == summary.statistics.channel_message_counts
        assert sum(counts.values()) == summary.statistics.message_count
        assert {attachment.name for attachment in summary.attachment_indexes} == {"parameters.json"}
