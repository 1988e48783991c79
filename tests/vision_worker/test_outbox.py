"""The pipe between worker and flight: nobody waits, the oldest fall out, records arrive whole."""

import os
from collections.abc import Iterator
from select import select

import pytest

from vision.outbox import Inbox, Outbox

TIMEOUT_S = 30.0


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    ends = os.pipe()
    yield ends
    for end in ends:
        os.close(end)


def receive(inbox: Inbox, read_fd: int, last: object) -> list[object]:
    got: list[object] = []
    while last not in got:
        assert select([read_fd], [], [], TIMEOUT_S)[0]
        got += inbox.drain()
    return got


def test_records_arrive_whole_and_in_order(pipe: tuple[int, int]) -> None:
    read_fd, write_fd = pipe
    inbox = Inbox(read_fd)
    records = [("first", 1), b"x" * 300_000, None, {"last": True}]
    outbox: Outbox[object] = Outbox(write_fd, depth=8)
    for record in records:
        outbox.put(record)
    assert receive(inbox, read_fd, records[-1]) == records


def test_put_returns_though_nobody_reads_and_the_oldest_fall_out(pipe: tuple[int, int]) -> None:
    read_fd, write_fd = pipe
    outbox: Outbox[tuple[int, bytes]] = Outbox(write_fd, depth=4)
    for number in range(500):
        outbox.put((number, b"x" * 50_000))  # more than any pipe holds
    got = [record[0] for record in receive(Inbox(read_fd), read_fd, (499, b"x" * 50_000)) if isinstance(record, tuple)]
    assert got[-4:] == [496, 497, 498, 499]
    assert got == sorted(got)
    assert len(got) < 500


def test_half_a_record_is_waited_for_without_blocking(pipe: tuple[int, int]) -> None:
    read_fd, write_fd = pipe
    far_read, far_write = os.pipe()
    Outbox(far_write, depth=1).put("a record")
    sent = os.read(far_read, 1000)
    inbox = Inbox(read_fd)
    os.write(write_fd, sent[:7])
    assert inbox.drain() == []
    os.write(write_fd, sent[7:] + sent)
    assert inbox.drain() == ["a record", "a record"]
    assert not inbox.is_ended
    for end in (far_read, far_write):
        os.close(end)


def test_the_writers_end_is_noticed_after_its_last_record() -> None:
    read_fd, write_fd = os.pipe()
    outbox: Outbox[str] = Outbox(write_fd, depth=4)
    outbox.put("bye")
    outbox.close(TIMEOUT_S)
    os.close(write_fd)
    inbox = Inbox(read_fd)
    assert inbox.drain() == ["bye"]
    assert inbox.is_ended
    assert inbox.drain() == []
    os.close(read_fd)
