"""What a pole or a tower is before insulators and conductors hang on it."""

from dataclasses import dataclass

from sitl.world.records import Member


@dataclass(frozen=True, slots=True)
class Hold:
    """Where a conductor is held: `right_m` of the axis for one who looks along the line.

    Its insulator is fastened `fixed_m` above the support's foot. A pin stands there and holds the wire `wire_m` above
    the foot; a string hangs down to `wire_m`, or is pulled level where the wire ends or turns.
    """

    right_m: float
    fixed_m: float
    wire_m: float

    @property
    def is_string(self) -> bool:
        """Whether the insulator hangs."""
        return self.wire_m < self.fixed_m


@dataclass(frozen=True, slots=True)
class Structure:
    """The members of a pole or tower, and where it holds its conductors and shield wires."""

    members: tuple[Member, ...]
    holds: tuple[Hold, ...]
    shield_holds: tuple[Hold, ...] = ()
