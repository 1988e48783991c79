"""The command: Ctrl-C ends it quietly, also while its parts are still being loaded."""

import sys

_EXIT_INTERRUPTED = 130  # as mission.ending has it, which is not loaded yet


def main() -> None:
    """Load the command line, and run it."""
    try:
        from mission.cli import main as run
    except KeyboardInterrupt:
        sys.exit(_EXIT_INTERRUPTED)
    run()
