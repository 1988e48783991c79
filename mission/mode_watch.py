"""Which flight modes our own commands explain; any other mode is somebody else's doing."""

from drivers.clock import NS_PER_S
from mission.autopilot import FlightMode, LandedState, VehicleState

GRACE_S = 2.5
"""How long after a command the mode before it still explains itself: PX4's heartbeat tells its mode once a second."""

_ANY = frozenset(FlightMode)


class ModeWatch:
    """Remembers what was commanded and when. Before the first command any mode is explained."""

    def __init__(self) -> None:
        self._modes = _ANY
        self._replaced: list[tuple[int, frozenset[FlightMode]]] = []

    @property
    def is_offboard(self) -> bool:
        """Whether offboard is what was commanded last."""
        return self._modes == {FlightMode.OFFBOARD}

    def command(self, now_ns: int, *modes: FlightMode) -> None:
        """Note a command that leads to one of `modes`."""
        self._replaced.append((now_ns, self._modes))
        self._modes = frozenset(modes)

    def explained(self, now_ns: int, state: VehicleState) -> frozenset[FlightMode]:
        """The modes that are explained now.

        On the ground any mode is harmless, and a landing ends in one of the autopilot's choice.
        """
        if not state.is_armed or state.landed is LandedState.ON_GROUND:
            return _ANY
        self._replaced = [old for old in self._replaced if now_ns - old[0] < GRACE_S * NS_PER_S]
        return self._modes.union(*(modes for _, modes in self._replaced))
