"""A damaged log is read but for what is damaged, and never looks whole."""

import random
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader, breakup_chunk

from drivers.clock import NS_PER_S
from drivers.mcap_stream import open_messages
from mission.log.blame.blame import find_excursions
from mission.log.blame.records import Kind
from mission.log.blame.signals import motion_of
from mission.log.copying import write_copy
from mission.log.damage import words_of_damage
from mission.log.errors import LogError
from mission.log.inspection import inspect_flight
from mission.log.page.curves import flight_curves
from mission.log.reader import Flight, find_flaws, read_flight, read_images, stream_log
from mission.log.task_spans import flight_start_ns
from tests.log.synthetic_flight import fly, write_log
from tests.support.command_line import lineflight

N_PLACES = 150


@dataclass(frozen=True)
class Place:
    """A chunk of the log: where its bytes lie in the file, and its messages by topic."""

    begin: int
    end: int
    counts: Counter[str]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("logs") / "flight.mcap"
    flown = list(fly(image_period_s=8.0))
    assert write_log(path, flown[: len(flown) // 4]).failure is None
    return path


@pytest.fixture(scope="module")
def places(log: Path) -> list[Place]:
    return chunks_of(log)


def chunks_of(log: Path) -> list[Place]:
    """Found by the mcap package, not by our own reader."""
    with log.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        topics = {channel.id: channel.topic for channel in summary.channels.values()}
        offsets = sorted((index.chunk_start_offset, index.chunk_length) for index in summary.chunk_indexes)
        file.seek(0)
        chunks = [
            record
            for record in StreamReader(file, emit_chunks=True, record_size_limit=None).records
            if isinstance(record, Chunk)
        ]
    return [
        Place(
            at,
            at + length,
            Counter(topics[one.channel_id] for one in breakup_chunk(chunk) if hasattr(one, "publish_time")),
        )
        for (at, length), chunk in zip(offsets, chunks, strict=True)
    ]


def flipped(data: bytes, at: int) -> bytes:
    return data[:at] + bytes([data[at] ^ (1 << at % 8)]) + data[at + 1 :]


def zeroed(data: bytes, block: int) -> bytes:
    return data[: block * 4096] + bytes(len(data[block * 4096 : (block + 1) * 4096])) + data[(block + 1) * 4096 :]


def damaged(data: bytes) -> Iterator[tuple[bytes, int, int]]:
    """Copies of a log with the stretch of bytes, from and to, in which each is damaged."""
    draw = random.Random("damage")
    for at in [*range(len(data) - 40, len(data)), *range(0, 300, 5), *draw.sample(range(len(data)), N_PLACES)]:
        yield flipped(data, at), at, at + 1
    for block in range(len(data) // 4096 + 1):
        yield zeroed(data, block), block * 4096, (block + 1) * 4096


def counted(path: Path) -> Counter[str]:
    with path.open("rb") as file:
        return Counter(topic for topic, _, _ in open_messages(file))


def test_damaged_anywhere_it_opens_and_has_every_message_of_the_sound_chunks(
    log: Path, places: list[Place], tmp_path: Path
) -> None:
    assert len(places) > 5
    path = tmp_path / "damaged.mcap"
    for data, begin, end in damaged(log.read_bytes()):
        if data == log.read_bytes():
            continue  # zeros were there before
        path.write_bytes(data)
        flight = read_flight(path)
        assert flight.damage is not None or flight.is_truncated, f"damaged from {begin} to {end}, it looks whole"
        sound = sum((one.counts for one in places if one.end <= begin or end <= one.begin), Counter())
        missing = sound - counted(path)
        assert not missing, f"damaged from {begin} to {end}, it lacks {missing} of its sound parts"
        n_hit = sum(begin < one.end and one.begin < end for one in places)
        assert flight.damage is None or flight.damage.n_skipped <= n_hit + 1  # an attachment may be hit, too


def test_several_damages_and_a_cut_are_read_around_or_refused_in_a_sentence(
    log: Path, places: list[Place], tmp_path: Path
) -> None:
    """What a cut log's channels are is told once: it may be lost. It is said then."""
    path = tmp_path / "damaged.mcap"
    draw = random.Random("damages")
    n_read = 0
    for _ in range(40):
        data = log.read_bytes()
        data = data[: draw.randrange(len(data) // 2, len(data))]
        hits = [draw.randrange(len(data)) for _ in range(draw.randint(1, 6))]
        for at in hits:
            data = flipped(data, at)
        path.write_bytes(data)
        try:
            flight = read_flight(path)
        except LogError as error:
            check_sentence(str(error))
            continue
        n_read += 1
        assert flight.is_truncated
        sound = sum(
            (
                one.counts
                for one in places
                if one.end <= len(data) and not any(one.begin <= at < one.end for at in hits)
            ),
            Counter(),
        )
        n_nameless = 0 if flight.damage is None else flight.damage.n_nameless
        assert sum((sound - counted(path)).values()) <= n_nameless
    assert n_read > 30


def check_sentence(words: str) -> None:
    assert re.search("[a-z](Error|Exception)", words) is None, words
    assert "\n" not in words


def damage_chunk(log: Path, place: Place, out: Path) -> None:
    out.write_bytes(flipped(log.read_bytes(), (place.begin + place.end) // 2))


def test_what_is_missing_is_said_with_its_duration(log: Path, places: list[Place], tmp_path: Path) -> None:
    whole, path = read_flight(log), tmp_path / "a.mcap"
    damage_chunk(log, places[-2], path)
    flight = read_flight(path)
    assert flight.damage is not None
    times_ns = {state.t_ns for state in whole.states} - {state.t_ns for state in flight.states}
    assert len(times_ns) == places[-2].counts["/vehicle/state"]
    lasted_ns = max(times_ns) - min(times_ns)
    assert lasted_ns <= flight.damage.missing_ns <= lasted_ns + NS_PER_S // 2
    words = words_of_damage(flight.damage)
    n_parts = len(places) + 1  # and an attachment
    missing_s = f"{flight.damage.missing_ns / NS_PER_S:.1f} s of the flight are missing."
    assert words == f"1 of {n_parts} parts of this log is damaged and was skipped: {missing_s}"
    assert find_flaws(path) == flight.flaws
    assert find_flaws(log).lines == ()


def test_inspect_and_export_say_it(log: Path, places: list[Place], tmp_path: Path) -> None:
    path, page = tmp_path / "a.mcap", tmp_path / "a.html"
    damage_chunk(log, places[-2], path)
    words = words_of_damage(find_flaws(path).damage)  # type: ignore[arg-type]
    told = lineflight("inspect", path, "--html", page)
    assert told.code == 0, told.err
    assert words in " ".join(told.out.split())
    assert words in page.read_text(encoding="utf-8")
    assert lineflight("inspect", path, "--json").json["damage"] == words
    assert lineflight("inspect", log, "--json").json["damage"] is None
    exported = lineflight("export", "csv", path, tmp_path / "tables")
    assert exported.code == 0
    assert f"{path}: {words}" in exported.err
    compared = lineflight("compare", path, log)
    assert compared.code == 0
    assert f"{path}: {words}" in compared.err
    assert f"{log}: " not in compared.err


def test_a_copy_of_a_damaged_log_holds_what_is_sound_and_tells_what_is_not(
    log: Path, places: list[Place], tmp_path: Path
) -> None:
    path, copy, again = (tmp_path / f"{name}.mcap" for name in "abc")
    damage_chunk(log, places[1], path)  # in which most channels are told
    write_copy(path, copy, [], lambda _: None)
    assert counted(copy) == counted(path) == sum((one.counts for one in places if one != places[1]), Counter())
    assert find_flaws(copy).damage == find_flaws(path).damage is not None
    write_copy(copy, again, [], lambda _: None)
    assert find_flaws(again).damage == find_flaws(path).damage


def without_mission(log: Path, places: list[Place], out: Path) -> Flight:
    damage_chunk(log, places[0], out)
    return read_flight(out)


def test_without_the_mission_the_rest_is_read(log: Path, places: list[Place], tmp_path: Path) -> None:
    whole, flight = read_flight(log), without_mission(log, places, tmp_path / "a.mcap")
    assert flight.damage is not None
    assert flight.states == whole.states
    assert (flight.mission.name, flight.mission.sha256) == (whole.mission.name, whole.mission.sha256)
    assert flight.mission.unix_minus_flight_ns == whole.mission.unix_minus_flight_ns
    assert flight.mission.metadata == whole.mission.metadata
    assert [t_ns for t_ns, _ in read_images(flight)] == [t_ns for t_ns, _ in read_images(whole)]
    assert sum(1 for _ in stream_log(flight.path)) > len(whole.states)


@pytest.mark.parametrize("begin", [0, 8])
def test_a_log_of_which_nothing_is_left_is_refused_in_a_sentence(log: Path, tmp_path: Path, begin: int) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(log.read_bytes()[:begin] + bytes(log.stat().st_size - begin))
    with pytest.raises(LogError) as raised:
        read_flight(path)
    check_sentence(str(raised.value))
    assert ("is damaged" if begin else "is not an MCAP file") in str(raised.value)


def test_nobody_is_blamed_for_what_stood_in_a_damaged_part(tmp_path: Path) -> None:
    log, path = tmp_path / "a.mcap", tmp_path / "b.mcap"
    assert write_log(log, list(fly())).failure is None
    assert inspect_flight(read_flight(log)).excursions == ()
    size = log.stat().st_size
    path.write_bytes(flipped(flipped(log.read_bytes(), size // 2), size * 5 // 7))
    flight = read_flight(path)
    assert Kind.UNSEEN in {excursion.kind for excursion in find_excursions(flight)}  # if one looks at records alone
    assert inspect_flight(flight).excursions == ()


def test_no_damage_of_one_part_makes_a_flight_worse_than_it_was(tmp_path: Path) -> None:
    """What began before a hole or ended in it is not taken for what came after."""
    log, path = tmp_path / "a.mcap", tmp_path / "b.mcap"
    assert write_log(log, list(fly(image_period_s=2.0))).failure is None
    whole = inspect_flight(read_flight(log))
    assert whole.lateral is not None
    assert whole.setpoints.max_gap_ms is not None
    n_lost = 0
    for place in chunks_of(log):
        damage_chunk(log, place, path)
        flight = read_flight(path)
        report = inspect_flight(flight)
        n_lost += len(report.tasks) != len(whole.tasks) or any(task.result == "unfinished" for task in report.tasks)
        assert report.excursions == whole.excursions
        assert report.setpoints.max_gap_ms is not None
        assert report.setpoints.max_gap_ms < 1.5 * whole.setpoints.max_gap_ms
        assert report.lateral is None or report.lateral.max_m < 1.5 * whole.lateral.max_m
        assert (report.ended_in is None) or report.result != "completed"
        for curve in flight_curves(flight, motion_of(flight), flight_start_ns(flight)).values():
            assert curve["t"] == sorted(curve["t"])
    assert n_lost > 1


def test_a_copy_of_a_cut_and_damaged_log_can_be_made(log: Path, places: list[Place], tmp_path: Path) -> None:
    """A channel's schema may have stood in the damaged part, and no summary tells it again."""
    for number, place in enumerate(places[:-1]):
        path, copy = tmp_path / f"{number}.mcap", tmp_path / f"{number}-copy.mcap"
        damage_chunk(log, place, path)
        path.write_bytes(path.read_bytes()[: places[-1].end])
        write_copy(path, copy, [], lambda _: None)
        assert counted(copy) == counted(path)
        assert find_flaws(copy).damage == find_flaws(path).damage is not None


def test_what_another_tool_put_behind_the_log_damages_nothing(log: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    for more in (b"x", bytes(4096)):
        path.write_bytes(log.read_bytes() + more)
        flight = read_flight(path)
        assert flight.damage is None or flight.damage.n_skipped == 0
        assert flight.states == read_flight(log).states


def test_records_of_another_tool_are_passed_over(log: Path, places: list[Place], tmp_path: Path) -> None:
    """The specification leaves opcodes from 0x80 on to applications."""
    path, data = tmp_path / "a.mcap", log.read_bytes()
    own = b"\x90" + (5).to_bytes(8, "little") + b"hello"
    path.write_bytes(data[: places[1].begin] + own + data[places[1].begin :])
    flight = read_flight(path)
    assert flight.states == read_flight(log).states
    assert flight.damage is None or flight.damage.n_skipped == 0
