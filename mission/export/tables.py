"""A log as tables, one for each stream of records: CSV, or Parquet."""

import csv
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Protocol, Self

from mission.export.columns import Cell, Column, RowMaker, columns_of
from mission.export.output import new_folder
from mission.log.channels import CHANNEL_AT
from mission.log.reader import stream_log

UNIX_NS = Column("unix_ns", int, ())
"""The first column of every table: the record's time since 1970 [ns]."""


class Table(Protocol):
    """A file that takes rows; a context manager, which ends it."""

    def write(self, row: list[Cell]) -> None:
        """Append a row."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *error: object) -> None: ...


def export_tables(
    log: Path,
    folder: Path,
    suffix: str,
    open_table: Callable[[Path, Sequence[Column]], Table],
    on_record: Callable[[], None] = lambda: None,
) -> dict[str, int]:
    """Write a log's records into `folder`: a table for each stream, such as vehicle_state.csv of /vehicle/state.

    Rows stand in the order in which they were logged. Returns the number of rows by the table's file name. Raises
    LogError, ExportError when `folder` is not empty, OutputError when it cannot be written.
    """
    n_rows: dict[str, int] = {}
    with new_folder(folder) as unfinished, ExitStack() as open_tables:
        tables: dict[str, tuple[str, RowMaker, Table]] = {}
        for topic, log_time_ns, content in stream_log(log):
            if topic not in CHANNEL_AT:
                continue
            if topic not in tables:
                columns = columns_of(CHANNEL_AT[topic].record)
                name = topic.strip("/").replace("/", "_") + suffix
                table = open_tables.enter_context(open_table(unfinished / name, (UNIX_NS, *columns)))
                tables[topic] = name, RowMaker(columns), table
            name, rows, table = tables[topic]
            table.write([log_time_ns, *rows.row(content)])
            n_rows[name] = n_rows.get(name, 0) + 1
            on_record()
    return n_rows


class CsvTable:
    """A table as CSV in UTF-8 with a header; what is missing is empty, truth is `true` or `false`."""

    def __init__(self, file: Path, columns: Sequence[Column]) -> None:
        self._file = file.open("w", encoding="utf-8", newline="")
        self._rows = csv.writer(self._file, lineterminator="\n")
        self._rows.writerow([column.name for column in columns])
        self._truths = [k for k, column in enumerate(columns) if column.kind is bool]

    def write(self, row: list[Cell]) -> None:
        """Append a row."""
        for k in self._truths:
            if row[k] is not None:
                row[k] = "true" if row[k] else "false"
        self._rows.writerow(row)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()
