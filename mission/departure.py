"""Where a flight begins: at rest with a new mission, or where an interrupted one is taken up again."""

from dataclasses import dataclass

from mission.autopilot import Autopilot, GlobalPoint, Setpoint, VehicleState
from mission.plan import MissionPlan
from mission.preflight_checks import is_handed_over, not_at_rest
from mission.resumption import CannotResumeError, Resumption
from mission.tasks.task import FlightMemory


@dataclass(frozen=True, slots=True)
class Departure:
    """What is known when a flight begins, in the autopilot's local frame, whose `origin` on Earth may be unknown.

    `here` is where the vehicle is. A flight `is_flying` from its beginning where a pilot has handed it over, and then
    goes to `rejoin_at` first; one that is resumed on the ground takes off before. `resumption` None: a new mission.
    """

    origin: GlobalPoint | None
    here: Setpoint
    memory: FlightMemory
    is_flying: bool
    resumption: Resumption | None
    rejoin_at: Setpoint

    def is_as_it_was(self, state: VehicleState | None) -> bool:
        """Whether the vehicle still stands at rest, or still hovers as it was handed over: nobody was quicker."""
        if state is None:
            return False
        return is_handed_over(state) if self.is_flying else not_at_rest(state) is None


async def depart(
    autopilot: Autopilot,
    plan: MissionPlan,
    theta_0_rad: float | None,
    state: VehicleState,
    vehicle_uid: str,
    resumption: Resumption | None,
) -> Departure:
    """Find out where the flight begins. `theta_0_rad` None: the yaw now. Raises CannotResumeError."""
    here = Setpoint(state.north_m, state.east_m, state.down_m, state.yaw_rad)
    origin = await autopilot.read_origin()
    if resumption is None:
        memory = FlightMemory(here, state.yaw_rad if theta_0_rad is None else theta_0_rad)
        return Departure(origin, here, memory, is_flying=False, resumption=None, rejoin_at=here)
    if origin is None:
        raise CannotResumeError("the autopilot does not tell where on Earth it is")
    is_flying = is_handed_over(state)
    if is_flying:
        resumption = resumption.in_the_air(plan)
    refusal = resumption.refusal(plan, state, vehicle_uid, origin, is_flying=is_flying)
    if refusal is not None:
        raise CannotResumeError(refusal)
    memory, rejoin_at = resumption.locate(origin, here, is_flying=is_flying)
    return Departure(origin, here, memory, is_flying, resumption, rejoin_at)
