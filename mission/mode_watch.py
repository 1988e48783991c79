"""Which flight modes our own commands explain; any other mode is somebody else's doing."""

from dataclasses import dataclass

from drivers.clock import NS_PER_S
from mission.autopilot import FlightMode, LandedState, VehicleState

GRACE_S = 2.5
"""How long after a command the mode before it still explains itself: PX4's heartbeat tells its mode once a second.

After it, a mode that did not change is as little ours as one that did: an autopilot that said yes and stayed, and a
pilot who was quicker than the heartbeat, look the same from here, and the pilot is never fought.
"""

_ANY = frozenset(FlightMode)


@dataclass(frozen=True, slots=True)
class ModeView:
    """What our commands say about flight modes: `explained` are ours; `is_offboard`: offboard was commanded last.

    `was_offboard` says that the autopilot was in offboard since.
    """

    explained: frozenset[FlightMode]
    is_offboard: bool
    was_offboard: bool


class ModeWatch:
    """Remembers what was commanded and when. Before the first command any mode is explained.

    A command is announced before it is sent and noted as accepted afterwards. When its answer gets lost nobody knows
    whether the autopilot obeyed: then the modes before and after it both stay explained.
    """

    def __init__(self) -> None:
        self._modes = _ANY
        self._wanted = _ANY
        self._was_offboard = False
        self._fading: list[tuple[int, frozenset[FlightMode]]] = []  # (when it was replaced [ns], modes)

    @property
    def is_offboard(self) -> bool:
        """Whether offboard is what was commanded last."""
        return self._wanted == {FlightMode.OFFBOARD}

    def begin(self, mode: FlightMode) -> None:
        """We take over a vehicle that flies `mode`; nothing was commanded yet, and no other mode is explained."""
        self._modes = self._wanted = frozenset({mode})

    def announce(self, *modes: FlightMode) -> None:
        """A command that leads to one of `modes` is about to be sent, or the autopilot will go there by itself."""
        self._modes = frozenset(modes) if self._modes == _ANY else self._modes.union(modes)

    def accept(self, now_ns: int, *modes: FlightMode) -> None:
        """The autopilot has accepted a command that leads to one of `modes`."""
        self._fading.append((now_ns, self._modes))
        if self._wanted != frozenset(modes):
            self._was_offboard = False
        self._modes = self._wanted = frozenset(modes)

    def view(self, now_ns: int, state: VehicleState) -> ModeView:
        """What our commands say about the modes now."""
        if self.is_offboard and state.mode is FlightMode.OFFBOARD:
            self._was_offboard = True
        return ModeView(self.explained(now_ns, state), self.is_offboard, self._was_offboard)

    def explained(self, now_ns: int, state: VehicleState) -> frozenset[FlightMode]:
        """The modes that are explained now.

        On the ground any mode is harmless, and a landing ends in one of the autopilot's choice.
        """
        if not state.is_armed or state.landed is LandedState.ON_GROUND:
            return _ANY
        self._fading = [old for old in self._fading if now_ns - old[0] < GRACE_S * NS_PER_S]
        return self._modes.union(*(modes for _, modes in self._fading))
