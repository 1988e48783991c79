"""What a person who watches may ask of a flight."""

import enum


class Wish(enum.StrEnum):
    """How the operator wants the mission to end; safety decides what becomes of it (docs/safety.md)."""

    HOLD = "hold"
    """Stop, and hover in the autopilot's own hold mode."""
    LAND = "land"
    """Come down: here, or where the line may be below, at the take-off point."""
