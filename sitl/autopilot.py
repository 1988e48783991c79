"""The simulated vehicle with its autopilot, PX4 v1.16's behaviour as a model that is only ever stepped.

No sockets, threads or wall clock: time is the autopilot's own, and the same inputs give the same flight.
"""

import math
from collections import deque

from sitl.battery import Battery
from sitl.commander import Commander
from sitl.control import Estimate, Setpoint
from sitl.estimator import Estimator
from sitl.failsafes import Failsafe, Observation
from sitl.flight_control import FlightControl
from sitl.flight_tasks import Return, Takeoff
from sitl.modes import Answer, Landed, Mode, Severity
from sitl.navigator import Navigator, Situation
from sitl.parameters import Parameters
from sitl.pilot import Pilot, Sticks
from sitl.place import Home, Origin
from sitl.positioning import Positioning
from sitl.preflight import Preflight
from sitl.takeoff_landing import LandDetector, Ramp
from sitl.vehicle import Vector, Vehicle, euler_of
from sitl.wind import Wind
from sitl.witness import Witness

_HOME_S = 1.14  # after boot: the first home
_MIN_SATELLITES = 4  # for a fix
DEFAULT_UID = 5283920058631409231  # that of every PX4 SITL
_NAVIGATOR_S = 0.04  # from a mode change to what PX4's navigator says about it


class SimAutopilot:
    """A vehicle on the ground at the world's origin, and the autopilot that flies it.

    Read `estimate`, `commander`, `landed`, `home`, `battery`, `setpoint`, `thrust`; `vehicle` is the truth.
    """

    def __init__(
        self,
        vehicle: Vehicle | None = None,
        wind: Wind | None = None,
        *,
        seed: int = 0,
        parameters: Parameters | None = None,
        origin: Origin | None = None,
        speed: float = 1.0,
        is_noisy: bool = True,
        uid: int = DEFAULT_UID,
        witness: Witness | None = None,
    ) -> None:
        """Boot. `speed` is how many times faster than the wall clock it will be stepped (see Commander).

        `uid` is the hardware's number, 64 bits (AUTOPILOT_VERSION): another one is another vehicle.
        `witness` watches what the vehicle comes near to, and touches; without one nothing stands in its way.
        """
        self.uid = uid
        self.witness = witness
        self.vehicle = vehicle or Vehicle()
        self.wind = wind or Wind(0.0, seed)
        self.parameters = parameters or Parameters()
        self.origin = origin or Origin()
        self.battery = Battery(self.vehicle.airframe.pack)
        self.boot_s = 0.0
        self.commander = Commander(self.parameters, self.say, speed=speed)
        self._estimator = Estimator(seed, is_noisy=is_noisy)
        self.estimate: Estimate = self._estimator.step(1e-3, self.vehicle)
        self.home: Home | None = None
        self._texts: deque[tuple[float, Severity, str]] = deque()
        hover_thrust = self.vehicle.airframe.hover_thrust
        self._land_detector = LandDetector(hover_thrust)
        self._control = FlightControl(self.parameters, hover_thrust)
        self._air_m_s: Vector = (0.0, 0.0, 0.0)
        self._was_landing = False
        self._was_armed = False
        self._setpoint_s: float | None = None
        self._has_taken_off = False
        self._pilot = Pilot(self.parameters, speed)
        self._speed = speed
        self._ground_station_s = -math.inf
        self._navigator = Navigator(self.parameters, self.origin, self._pilot, self._say_later)
        self._stick_mode = self.mode
        self._preflight = Preflight(self.parameters, self.say)
        self._positioning = Positioning()
        self.last_fix_m: Vector = self.estimate.position_m

    # --- what a ground station or an application asks ---

    @property
    def mode(self) -> Mode:
        """The mode that is flown."""
        return self.commander.mode

    @property
    def is_armed(self) -> bool:
        """Whether the motors are armed."""
        return self.commander.is_armed

    @property
    def failsafe(self) -> Failsafe | None:
        """Why the autopilot acts against the intended mode; None when it does not."""
        return self.commander.failsafe

    @property
    def setpoint(self) -> Setpoint | None:
        """What the flight task asks of the controllers; None on the ground."""
        return self._control.setpoint

    @property
    def thrust(self) -> float:
        """The thrust that is asked of the motors, 0 to 1."""
        return self._control.thrust

    @property
    def landed(self) -> Landed:
        """The landed state, as EXTENDED_SYS_STATE tells it."""
        if self._land_detector.is_landed:
            return Landed.ON_GROUND
        if self.mode is Mode.TAKEOFF and self._navigator.has_left_by_takeoff:
            return Landed.TAKEOFF
        if self._navigator.task is not None and self._navigator.task.is_landing:
            return Landed.LANDING
        return Landed.IN_AIR

    @property
    def has_gps(self) -> bool:
        """Whether the receiver has a fix (SIM_GPS_USED satellites, GPS_RAW_INT)."""
        return self.parameters.get("SIM_GPS_USED") >= _MIN_SATELLITES

    @property
    def is_position_ok(self) -> bool:
        """Whether SYS_STATUS tells that the global position is good (the GPS sensor is present)."""
        return self._positioning.is_reported

    @property
    def is_position_valid(self) -> bool:
        """Whether the autopilot itself would still fly by its horizontal position."""
        return self._positioning.is_valid

    @property
    def sticks(self) -> Sticks | None:
        """Where a pilot's sticks stand; None while none come."""
        return self._pilot.sticks

    @property
    def has_seen_setpoints(self) -> bool:
        """Whether any offboard setpoint ever came."""
        return self._setpoint_s is not None

    def arm(self) -> Answer:
        """Arm the motors."""
        was_armed = self.is_armed
        answer = self.commander.arm()
        if self.is_armed and not was_armed:
            self._set_home()
            self._has_taken_off = False
            if self.mode is Mode.TAKEOFF:
                self._navigator.begin_takeoff()
        return answer

    def disarm(self, *, is_forced: bool = False) -> Answer:
        """Disarm the motors; in the air only when forced."""
        return self.commander.disarm(is_forced=is_forced)

    def takeoff(self, altitude_m: float | None = None) -> Answer:
        """Take off to `altitude_m` AMSL, or to MIS_TAKEOFF_ALT over home; disarmed it waits for arming."""
        self._navigator.ask_takeoff(altitude_m)
        return self.commander.request(Mode.TAKEOFF)

    def land(self) -> Answer:
        """Land here."""
        answer = self.commander.request(Mode.LAND)
        self.say(Severity.INFO, "Landing at current position")
        return answer

    def set_mode(self, mode: Mode) -> Answer:
        """Change the flight mode."""
        if mode is Mode.TAKEOFF:
            return self.takeoff()
        return self.commander.request(mode)

    def set_position_setpoint(self, north_m: float, east_m: float, down_m: float, yaw_rad: float) -> None:
        """Take an offboard setpoint: local NED [m], yaw [rad] (SET_POSITION_TARGET_LOCAL_NED).

        What is not finite keeps what is: the position where the vehicle is, the yaw that was last asked for offboard.
        """
        self._navigator.aim((north_m, east_m, down_m, yaw_rad), self.estimate)
        self._setpoint_s = self.boot_s
        # PX4's commander sees a fresh stream at once: MAVSDK sends a setpoint and the mode change in one go.
        self.commander.see_setpoint()

    def set_sticks(self, pitch: float, roll: float, throttle: float, yaw: float) -> None:
        """Take a pilot's sticks (MANUAL_CONTROL): pitch forward, roll and yaw right -1 to 1, throttle 0 to 1.

        Centred is 0, but 0.5 for the throttle. They have to come again within COM_RC_LOSS_T, or count as gone.
        """
        self._pilot.take(Sticks(pitch, roll, throttle, yaw), self.boot_s)

    def see_ground_station(self) -> None:
        """A ground station's heartbeat has just come; without one for COM_DL_LOSS_T it counts as gone."""
        self._ground_station_s = self.boot_s

    def set_parameter(self, name: str, value: float | int) -> None:
        """Write a parameter; raises KeyError, TypeError and ValueError as Parameters.set does."""
        self.parameters.set(name, value)
        self._control.tune()

    def drain_texts(self) -> list[tuple[Severity, str]]:
        """The autopilot's status texts since the last call, oldest first."""
        due = []
        while self._texts and self._texts[0][0] <= self.boot_s:
            _, severity, text = self._texts.popleft()
            due.append((severity, text))
        return due

    # --- time ---

    def step(self, dt_s: float) -> None:
        """Let `dt_s` [s] of flight time pass; at most 10 ms for the controllers' sake."""
        self.boot_s += dt_s
        vehicle, commander = self.vehicle, self.commander
        self._pilot.step(self.boot_s)
        self._positioning.step(self.boot_s, has_gps=self.has_gps)
        self._rest_sticks()
        commander.step(self._observation())
        self._rest_sticks()
        if self._was_armed and not commander.is_armed:
            self._set_home()
            self._preflight.disarmed(self.boot_s)
        self._preflight.step(dt_s, self.boot_s, has_gps=self.has_gps, is_armed=commander.is_armed)
        self._was_armed = commander.is_armed
        self._follow_mode()
        self._control.prepare(
            dt_s,
            is_armed=commander.is_armed,
            wants_takeoff=self._navigator.wants_takeoff(self.estimate),
            is_landed=self._land_detector.is_landed,
        )
        has_let_go = self._land_detector.has_let_go
        torque = self._control.step(dt_s, self._navigator.task, self.estimate, vehicle.height_m, has_let_go=has_let_go)
        airspeed_m_s = math.dist(vehicle.velocity_m_s, self._air_m_s)
        self._air_m_s = self.wind.step(dt_s, vehicle.height_m, airspeed_m_s, vehicle.position_m)
        vehicle.step(dt_s, self.thrust, torque, self._air_m_s)
        self._look_for_contact()
        self.battery.step(dt_s, vehicle.power_w)
        vehicle.supply = self.battery.thrust_share
        drain_s = self.parameters.get("SIM_BAT_DRAIN")
        if drain_s > 0 and commander.is_armed:
            least = self.parameters.get("SIM_BAT_MIN_PCT") / 100
            self.battery.drain(dt_s, empty_after_s=drain_s, least=least)
        self.estimate = self._estimator.step(
            dt_s, vehicle, has_gps=self._positioning.has_gps, airspeed_m_s=airspeed_m_s
        )
        if self._positioning.has_gps:
            self.last_fix_m = self.estimate.position_m
        self._detect_landing(dt_s)
        if self.home is None and self.boot_s >= _HOME_S and self.has_gps:
            self._set_home()

    def _look_for_contact(self) -> None:
        """What touches something breaks; once it lies still, its power is cut, as by whoever picks it up."""
        if self.witness is None:
            return
        vehicle = self.vehicle
        if vehicle.is_broken:
            if vehicle.is_on_ground and self.is_armed:
                self.commander.disarm(is_forced=True)
        elif self.witness.look(self.boot_s, vehicle) is not None:
            vehicle.crash()

    def _rest_sticks(self) -> None:
        """From a change of mode on, a stick counts as moved from where it is then."""
        if self.mode is not self._stick_mode:
            self._stick_mode = self.mode
            self._pilot.rest()

    def _follow_mode(self) -> None:
        """Fly the mode's task, and go on after a take-off."""
        task = self._navigator.task
        if isinstance(task, Takeoff) and task.is_done and self.mode is Mode.TAKEOFF:
            self.commander.finish_takeoff()
        self._navigator.follow(
            Situation(
                self.mode,
                self.estimate,
                self.home,
                is_armed=self.is_armed,
                is_landed=self._land_detector.is_landed,
                is_position_valid=self.is_position_valid,
            )
        )

    def _detect_landing(self, dt_s: float) -> None:
        detector, ramp = self._land_detector, self._control.ramp
        was_landed, was_landing = detector.is_landed, self._was_landing
        if not self.is_armed:
            detector.rest()
            return
        detector.step(
            dt_s,
            is_touching=self.vehicle.is_on_ground,
            is_ramping=ramp is Ramp.RAMPUP,
            is_flying=ramp is Ramp.FLIGHT,
            thrust=self.thrust,
        )
        task = self._navigator.task
        self._was_landing = isinstance(task, Return) and task.is_landing
        if self._was_landing and not was_landing:
            self.say(Severity.INFO, "RTL: land at destination")
        if was_landed and not detector.is_landed:
            self._has_taken_off = True
            self.say(Severity.INFO, "Takeoff detected")
            self._set_home()
        elif detector.is_landed and not was_landed:
            self.say(Severity.INFO, "Landing detected")

    def _observation(self) -> Observation:
        distance_m = height_m = 0.0
        if self.home is not None:
            (n, e, d), (home_n, home_e, home_d) = self.estimate.position_m, self.home.position_m
            distance_m, height_m = math.hypot(n - home_n, e - home_e), home_d - d
        return Observation(
            boot_s=self.boot_s,
            setpoint_age_s=None if self._setpoint_s is None else self.boot_s - self._setpoint_s,
            is_landed=self._land_detector.is_landed,
            landed_s=self._land_detector.landed_s,
            has_taken_off=self._has_taken_off,
            battery=self.battery.remaining,
            is_position_valid=self.is_position_valid,
            has_sticks=self.sticks is not None,
            has_ground_station=self.boot_s - self._ground_station_s
            < self.parameters.get("COM_DL_LOSS_T") * self._speed,
            is_stick_moving=self._pilot.is_moving,
            distance_m=distance_m,
            height_m=height_m,
        )

    def _set_home(self) -> None:
        if not self.has_gps:
            return
        yaw_rad = euler_of(self.estimate.quaternion)[2]
        self.home = Home(self.estimate.position_m, yaw_rad, self.boot_s)

    def say(self, severity: Severity, text: str, *, delay_s: float = 0.0) -> None:
        """Send a status text, `delay_s` [s] from now."""
        self._texts.append((self.boot_s + delay_s, severity, text))

    def _say_later(self, text: str) -> None:
        self.say(Severity.INFO, text, delay_s=_NAVIGATOR_S)
