"""Tables hold what the log holds: every stream, every record, every field."""

import csv
import json
from collections import Counter
from dataclasses import fields
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from mission.autopilot import VehicleState
from mission.export.columns import Column, RowMaker, columns_of
from mission.export.errors import ExportError, OutputError
from mission.export.parquet import ParquetTable
from mission.export.tables import CsvTable, export_tables
from mission.log.channels import CHANNEL_AT, RECORD_CHANNELS
from mission.log.copying import write_copy
from mission.log.errors import LogError
from mission.log.reader import Flight, stream_log
from mission.log.records import VisionEntry


def csv_rows(file: Path) -> list[dict[str, str]]:
    with file.open(encoding="utf-8", newline="") as rows:
        return list(csv.DictReader(rows))


def logged(flight: Flight, kind: type) -> list[tuple[int, Any]]:
    return [(t_ns, record) for _, t_ns, record in stream_log(flight.path) if type(record) is kind]


def test_there_is_a_table_for_each_stream_with_all_its_records(flight: Flight, folder: Path) -> None:
    n_rows = export_tables(flight.path, folder, ".csv", CsvTable)
    in_log = Counter(topic for topic, _, _ in stream_log(flight.path) if topic in CHANNEL_AT)
    assert n_rows == {topic[1:].replace("/", "_") + ".csv": n for topic, n in in_log.items()}
    assert n_rows["vehicle_state.csv"] == len(flight.states) > 1000
    assert {file.name: len(csv_rows(file)) for file in folder.iterdir()} == n_rows


def test_csv_tells_every_field_exactly(flight: Flight, folder: Path) -> None:
    export_tables(flight.path, folder, ".csv", CsvTable)
    states = csv_rows(folder / "vehicle_state.csv")
    assert list(states[0]) == ["unix_ns", *(field.name for field in fields(VehicleState))]
    for row, state in zip(states, flight.states, strict=True):
        assert int(row["unix_ns"]) == state.t_ns + flight.mission.unix_minus_flight_ns
        assert float(row["north_m"]) == state.north_m
        assert (row["is_armed"], row["mode"], row["boot_ns"]) == (str(state.is_armed).lower(), state.mode.value, "")


def test_records_within_records_are_columns_and_lists_are_json(flight: Flight, folder: Path) -> None:
    export_tables(flight.path, folder, ".csv", CsvTable)
    rows = csv_rows(folder / "vision_report.csv")
    entries = [record for _, record in logged(flight, VisionEntry)]
    assert {entry.estimate is None for entry in entries} == {True, False}
    for row, entry in zip(rows, entries, strict=True):
        assert json.loads(row["power_lines_px"]) == [list(line) for line in entry.power_lines_px]
        if entry.estimate is None:
            assert row["estimate_angle_rad"] == row["estimate_conductors"] == ""
        else:
            assert float(row["estimate_angle_rad"]) == entry.estimate.angle_rad
            assert json.loads(row["estimate_conductors"]) == []
        assert row["estimate_next_span_offset_px"] == ""
    mission, *_ = csv_rows(folder / "mission.csv")
    assert mission["text"] == flight.mission.text
    assert json.loads(mission["metadata"]) == flight.mission.metadata


def test_parquet_holds_the_same_with_types(flight: Flight, folder: Path) -> None:
    n_rows = export_tables(flight.path, folder, ".parquet", ParquetTable)
    for channel in RECORD_CHANNELS:
        records = logged(flight, channel.record)
        if not records:
            continue
        name = channel.topic[1:].replace("/", "_") + ".parquet"
        assert n_rows.pop(name) == len(records)
        table = pq.read_table(folder / name)
        columns = columns_of(channel.record)
        assert table.column_names == ["unix_ns", *(column.name for column in columns)]
        rows = RowMaker(columns)
        read = [list(row.values()) for row in table.to_pylist()]
        assert read == [[t_ns, *rows.row(record)] for t_ns, record in records]
    assert n_rows == {}
    types = {field.name: str(field.type) for field in pq.read_schema(folder / "vision_report.parquet")}
    assert types["unix_ns"] == types["seq"] == "int64"
    assert (types["estimate_angle_rad"], types["has_image"], types["track"]) == ("double", "bool", "string")


def test_parquet_is_written_batch_by_batch(tmp_path: Path) -> None:
    with ParquetTable(tmp_path / "a.parquet", [Column("n", int, ("n",))]) as table:
        for n in range(25_000):
            table.write([n])
    file = pq.ParquetFile(tmp_path / "a.parquet")
    assert file.num_row_groups == 3
    assert file.read().column("n").to_pylist() == list(range(25_000))


@pytest.mark.parametrize("channel", RECORD_CHANNELS, ids=lambda channel: channel.topic)
def test_no_two_columns_share_a_name(channel: Any) -> None:
    names = ["unix_ns", *(column.name for column in columns_of(channel.record))]
    assert len(set(names)) == len(names)


def test_a_log_that_was_cut_off_gives_what_it_holds(flight: Flight, tmp_path: Path, folder: Path) -> None:
    cut = tmp_path / "cut.mcap"
    whole = flight.path.read_bytes()
    cut.write_bytes(whole[: len(whole) // 2])
    n_rows = export_tables(cut, folder, ".csv", CsvTable)
    assert 100 < n_rows["vehicle_state.csv"] < len(flight.states)


def test_nothing_is_left_of_an_export_that_failed(flight: Flight, tmp_path: Path, folder: Path) -> None:
    odd = tmp_path / "odd.mcap"
    middle_ns = flight.states[len(flight.states) // 2].t_ns + flight.mission.unix_minus_flight_ns

    def change(topic: str, log_time_ns: int, message: bytes) -> bytes:
        return b"{}" if topic == "/vehicle/state" and log_time_ns > middle_ns else message

    write_copy(flight.path, odd, [], lambda _: None, change)
    with pytest.raises(LogError, match="another version"):
        export_tables(odd, folder, ".csv", CsvTable)
    assert not folder.exists()
    folder.mkdir()
    with pytest.raises(LogError):
        export_tables(odd, folder, ".parquet", ParquetTable)
    assert list(folder.iterdir()) == []


def test_what_stands_there_already_stays(flight: Flight, folder: Path) -> None:
    folder.mkdir()
    (folder / "mine.csv").write_text("1")
    with pytest.raises(ExportError, match="not empty"):
        export_tables(flight.path, folder, ".csv", CsvTable)
    assert [(file.name, file.read_text()) for file in folder.iterdir()] == [("mine.csv", "1")]


def test_a_folder_that_cannot_be_made_is_told(flight: Flight, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError, match="cannot be made"):
        export_tables(flight.path, tmp_path / "file" / "out", ".csv", CsvTable)


def test_a_disk_that_takes_no_more_leaves_nothing(flight: Flight, folder: Path) -> None:
    class FullDisk(CsvTable):
        def write(self, row: list[Any]) -> None:
            raise OSError(28, "No space left on device")

    with pytest.raises(OutputError, match="No space left"):
        export_tables(flight.path, folder, ".csv", FullDisk)
    assert not folder.exists()
