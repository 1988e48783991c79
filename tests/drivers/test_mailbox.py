"""The mailbox of size one: newest wins, drops are counted, closing is noticed."""

import threading

import pytest

from drivers.camera.mailbox import Mailbox


def test_the_newest_item_wins_and_the_others_count_as_dropped() -> None:
    mailbox: Mailbox[int] = Mailbox()
    for item in (1, 2, 3):
        mailbox.put(item)
    assert mailbox.get(0.0) == 3
    assert mailbox.n_dropped == 2


def test_an_item_is_given_once() -> None:
    mailbox: Mailbox[int] = Mailbox()
    mailbox.put(1)
    assert [mailbox.get(0.0), mailbox.get(0.0)] == [1, None]
    mailbox.put(2)
    assert mailbox.n_dropped == 0


def test_a_waiting_reader_wakes_when_an_item_comes() -> None:
    mailbox: Mailbox[int] = Mailbox()
    got: list[int | None] = []
    reader = threading.Thread(target=lambda: got.append(mailbox.get(30.0)))
    reader.start()
    mailbox.put(7)
    reader.join(30.0)
    assert got == [7]


def test_after_close_the_last_item_may_be_taken_then_the_error_is_raised_every_time() -> None:
    mailbox: Mailbox[int] = Mailbox()
    mailbox.put(1)
    mailbox.close(OSError("unplugged"))
    mailbox.close()
    mailbox.put(2)
    assert mailbox.get(0.0) == 1
    for _ in range(2):
        with pytest.raises(OSError, match="unplugged"):
            mailbox.get(0.0)


def test_close_without_an_error_is_the_end() -> None:
    mailbox: Mailbox[int] = Mailbox()
    mailbox.close()
    with pytest.raises(EOFError):
        mailbox.get(0.0)


def test_close_wakes_a_waiting_reader() -> None:
    mailbox: Mailbox[int] = Mailbox()
    is_ended = threading.Event()

    def read() -> None:
        with pytest.raises(EOFError):
            mailbox.get(30.0)
        is_ended.set()

    reader = threading.Thread(target=read)
    reader.start()
    mailbox.close()
    assert is_ended.wait(30.0)
    reader.join()
