"""Writes the fault matrix into docs/safety.md: python -m tests.faults.page."""

from pathlib import Path

from tests.faults.faults import FAULTS
from tests.faults.table import EXPECTED, TASKS

PAGE = Path(__file__).parents[2] / "docs" / "safety.md"
BEGIN, END = "<!-- the fault matrix, by make safety-table -->\n", "<!-- end of the fault matrix -->\n"


def rendered() -> str:
    """The matrix as a table in Markdown."""
    lines = ["| fault | what happens | " + " | ".join(task.replace("_", " ") for task in TASKS) + " |"]
    lines.append("| --- | --- |" + " :-: |" * len(TASKS))
    for fault in FAULTS:
        cells = " | ".join(EXPECTED[fault.name].split())
        lines.append(f"| `{fault.name}` | {fault.what} | {cells} |")
    return "\n".join(lines) + "\n"


def with_matrix(page: str) -> str:
    """The page with the matrix as it is now."""
    head, _, rest = page.partition(BEGIN)
    _, _, tail = rest.partition(END)
    return f"{head}{BEGIN}\n{rendered()}\n{END}{tail}"


if __name__ == "__main__":
    PAGE.write_text(with_matrix(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
