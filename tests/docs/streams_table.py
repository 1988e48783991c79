"""The table of a log's streams, as docs/log.md shows it: `python -m tests.docs.streams_table` writes it anew."""

from pathlib import Path

from mission.log import channels

PAGE = Path(__file__).parents[2] / "docs" / "log.md"
_MARK = "<!-- streams -->\n"


def streams_table() -> str:
    """A row for each stream, from the code's own table."""
    rows = ["| topic | schema | what | rate | kept |", "| --- | --- | --- | --- | --- |"]
    for channel in channels.RECORD_CHANNELS:
        schema = f"`lineflight.{channel.record.__name__}` (JSON)"
        rows.append(f"| `{channel.topic}` | {schema} | {channel.what} | {channel.rate} | {channel.kept} |")
    shown = [f"| `{c.topic}` | `{c.schema}` | {c.what} | {c.rate} | {c.kept} |" for c in channels.FOXGLOVE_CHANNELS]
    return "\n".join([*rows, *shown])


def with_table(page: str) -> str:
    """The page with the table of today between its marks."""
    before, _, rest = page.partition(_MARK)
    after = rest.partition("\nAttachments:")[2]
    return f"{before}{_MARK}\n{streams_table()}\n\nAttachments:{after}"


if __name__ == "__main__":
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
