"""docs/state-machine.md, made from the code: run this module to write it again."""

from pathlib import Path

from mission.machine_drawing import draw_mission
from mission.plan_file import read_mission

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "state-machine.md"
MISSION = ROOT / "missions" / "first_follow.yaml"


def page() -> str:
    """The page as the code says it should be."""
    drawing = draw_mission(read_mission(MISSION).plan)
    return f"""# The flight's state machine

Drawn from the code (`mission/machine.py`) for `missions/first_follow.yaml`; `make diagram` draws it again, and
`lineflight check MISSION --diagram` draws that of any mission. An arrow from the frame leaves every task, whichever is
flown. What triggers what stands in [safety.md](safety.md).

```mermaid
{drawing}```
"""


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
