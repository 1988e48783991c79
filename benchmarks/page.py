"""The page of measurements: each benchmark owns a section of docs/benchmarks.md and leaves the others as they are."""

from collections.abc import Sequence
from pathlib import Path

PAGE = Path(__file__).resolve().parent.parent / "docs" / "benchmarks.md"


def table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = (" | ".join(cells) for cells in (columns, ["---"] * len(columns), *rows))
    return "\n".join(f"| {line} |" for line in lines)


def write_section(title: str, text: str, page: Path = PAGE) -> None:
    """Put `text` under the heading `## title` of the page, in place of what stood there; the last section goes last."""
    before = page.read_text(encoding="utf-8") if page.exists() else "# Benchmarks\n"
    heading = f"## {title}\n"
    head, found, rest = before.partition(heading)
    _, next_found, after = rest.partition("\n## ")
    tail = f"\n## {after}" if next_found else ""
    if not found:
        head = head.rstrip("\n") + "\n\n"
    page.write_text(f"{head}{heading}\n{text.strip()}\n{tail}", encoding="utf-8")
