"""The mission plan: what a mission file may say, with its defaults and limits.

Every key carries its unit; angles are degrees here, because people write them (`MissionPlan` is the only place inside
the program that keeps degrees). Names r, epsilon, P and theta_0 are [Ceron]'s, Algorithms 6.1 to 6.3.
"""

from typing import Annotated, Literal, Self, get_args

from pydantic import BaseModel, Field, model_validator
from pydantic_core import PydanticCustomError

from mission.plan_fence import FencePlan
from mission.plan_rules import DEFAULT_TAKEOFF_M
from mission.plan_section import AltitudeM, Metres, TimeLimitS
from mission.plan_section import Section as _Section


class Takeoff(_Section):
    """Arm and climb straight up in the autopilot's own take-off mode."""

    task: Literal["takeoff"]
    altitude_m: AltitudeM = Field(DEFAULT_TAKEOFF_M, description="Height above the take-off point.")
    time_limit_s: TimeLimitS = 60.0


class Ascend(_Section):
    """Climb straight up to a height above the take-off point."""

    task: Literal["ascend"]
    altitude_m: AltitudeM = Field(description="Height above the take-off point.")
    time_limit_s: TimeLimitS = 90.0


class Descend(_Section):
    """Sink straight down to a height above the take-off point."""

    task: Literal["descend"]
    altitude_m: AltitudeM = Field(description="Height above the take-off point.")
    time_limit_s: TimeLimitS = 90.0


class Rotate(_Section):
    """Turn on the spot, clockwise positive."""

    task: Literal["rotate"]
    angle_deg: float = Field(ge=-360, le=360, description="Angle from the present heading, clockwise positive.")
    time_limit_s: TimeLimitS = 60.0


class MoveForward(_Section):
    """Fly a distance straight ahead: in metres, or as far as move_until went."""

    task: Literal["move_forward"]
    distance_m: Metres | Literal["as_move_until"] = Field(
        description="Metres, or as_move_until: the distance that the last move_until took."
    )
    time_limit_s: TimeLimitS = 120.0


class MoveUntil(_Section):
    """Fly along theta_0 until the line is seen ([Ceron] Algorithm 6.1) and, by default, until it is right below."""

    task: Literal["move_until"]
    max_distance_m: Metres = Field(40.0, description="Give up when the line was not found within this distance.")
    n_detections: int = Field(4, ge=1, le=100, description="Frames in a row that must show the line.")
    until: Literal["overhead", "detected"] = Field(
        "overhead", description="Stop over the line, or as soon as it was detected as the thesis did."
    )
    time_limit_s: TimeLimitS = 90.0


class Align(_Section):
    """Turn until the line runs along the vehicle's axis ([Ceron] Algorithm 6.2)."""

    task: Literal["align"]
    turn: Literal["nearest", "right", "left"] = Field(
        "nearest", description="Which way to turn; a line has two directions, and at 90 degrees both are as near."
    )
    n_detections: int = Field(4, ge=1, le=100, description="Frames in a row that must be within epsilon.")
    time_limit_s: TimeLimitS = 45.0


class FollowLines(_Section):
    """Fly along the line by sight ([Ceron] Algorithm 6.3)."""

    task: Literal["follow_lines"]
    distance_m: Metres = Field(description="How far to fly along the line.")
    time_limit_s: TimeLimitS = 600.0


class Return(_Section):
    """Fly home and land in the autopilot's own return mode."""

    task: Literal["return"]
    time_limit_s: TimeLimitS = 300.0


class Land(_Section):
    """Land here in the autopilot's own land mode, and see it disarm."""

    task: Literal["land"]
    time_limit_s: TimeLimitS = 120.0


class Hold(_Section):
    """Hover for a while."""

    task: Literal["hold"]
    duration_s: TimeLimitS = Field(description="How long to hover.")
    time_limit_s: TimeLimitS = 3600.0


AnyTask = Takeoff | Ascend | Descend | Rotate | MoveForward | MoveUntil | Align | FollowLines | Return | Land | Hold
TaskPlan = Annotated[AnyTask, Field(discriminator="task")]
TASK_MODELS: dict[str, type[BaseModel]] = {
    get_args(model.model_fields["task"].annotation)[0]: model for model in get_args(AnyTask)
}
"""The section of each task, by its name in the file."""


ParameterCheck = Literal[
    "offboard_loss_time",
    "offboard_loss_action",
    "stick_takeover",
    "return_altitude",
    "speeds",
    "autopilot_fence",
    "low_battery_action",
    "station_loss_action",
]
"""The pre-flight checks of the autopilot's parameters (mission/parameter_checks.py)."""


class VehiclePlan(_Section):
    """The link to the autopilot, and the battery; the defaults suit a hexacopter of the DJI F550's class."""

    connection: str = Field(
        "udpin://0.0.0.0:14540", description="MAVSDK connection URL, e.g. serial:///dev/ttyAMA0:921600."
    )
    ready_time_limit_s: TimeLimitS = Field(180.0, description="How long to wait until the vehicle can arm.")
    battery_wh: float = Field(75.0, gt=0, le=10000, description="Energy of the full battery, e.g. 4S 5.2 Ah: 75 Wh.")
    hover_power_w: float = Field(350.0, gt=0, le=20000, description="Power that hovering takes, avionics included.")
    accept: list[ParameterCheck] = Field(
        [], max_length=20, description="Pre-flight checks of parameters that only warn where they would refuse to fly."
    )


class CameraPlan(_Section):
    """The camera below the vehicle: image up is the vehicle's forward, image right its right."""

    source: str = Field(
        "v4l2:/dev/video0", description="v4l2:DEVICE or file:PATH; a dry-run uses the simulated camera."
    )
    width_px: int = Field(640, ge=64, le=4096)
    height_px: int = Field(480, ge=64, le=4096)
    rate_hz: float = Field(30.0, gt=0, le=120)
    hfov_deg: float = Field(
        80.0, ge=10, le=150, description="Horizontal field of view of a lens that keeps straight lines straight."
    )
    calibration: str | None = Field(
        None,
        min_length=1,
        description="A file from lineflight camera calibrate, beside this one or with its path; replaces hfov_deg.",
    )
    pixel_format: str | None = Field(
        None, pattern=r"^[A-Z0-9 ]{4}$", description="V4L2 only: YUYV, MJPG, ...; by default what is fast enough."
    )
    controls: dict[str, int] = Field(
        {},
        max_length=50,
        description="V4L2 only: controls to set, in this order, by the names of lineflight camera show, e.g. "
        "{auto_exposure: 1, exposure_time_absolute: 20}.",
    )

    @model_validator(mode="after")
    def _calibration_tells_the_field_of_view(self) -> Self:
        if self.calibration is not None and "hfov_deg" in self.model_fields_set:
            raise PydanticCustomError("two_lenses", "either calibration or hfov_deg, not both")
        return self


class VisionPlan(_Section):
    """How frames become estimates."""

    presence_scale: float = Field(
        1.0, gt=0, le=10, description="Multiplies the presence threshold: above 1 asks for more before a line counts."
    )
    max_conductor_diameter_m: float = Field(
        0.04, gt=0, le=0.5, description="What is wider, at the height over the line, is no conductor."
    )
    log_rate_hz: float = Field(4.0, ge=0, le=30, description="Frames a second that the log keeps.")


class GuidancePlan(_Section):
    """How estimates become setpoints."""

    law: Literal["centred", "thesis"] = Field(
        "centred", description="thesis: yaw alone as in Algorithm 6.3. centred: also keeps the vehicle over the line."
    )
    r_m_s: float = Field(2.5, gt=0, le=10, description="r: step length along the line, per second.")
    P_per_s: float = Field(0.8, gt=0, le=5, description="P: share of the angle's error taken away, per second.")
    epsilon_deg: float = Field(5.0, gt=0, le=30, description="epsilon: align ends below this angle.")
    theta_0_deg: float | None = Field(
        None, ge=-360, le=360, description="theta_0: heading of move_until; by default the yaw at the start."
    )
    climb_m_s: float = Field(2.0, gt=0, le=5)
    descend_m_s: float = Field(1.5, gt=0, le=5)
    yaw_rate_deg_s: float = Field(45.0, gt=0, le=120)
    lateral_per_s: float = Field(4.0, gt=0, le=5, description="Share of the offset taken away, per second (centred).")
    lateral_max_m_s: float = Field(1.0, gt=0, le=5)
    lateral_lead: float = Field(
        1.0, ge=0, le=1.5, description="The setpoint goes so far beyond the line as the vehicle is from it (centred)."
    )
    height_over_line_m: float = Field(
        6.0,
        gt=0,
        le=100,
        description="Roughly. What is more than twice as deep is not taken for the line, nor what runs further beside "
        "it than three quarters of this; until the flight has told, offsets in the image become metres by it.",
    )
    conductor_spacing_m: float | None = Field(
        None,
        gt=0,
        le=20,
        description="Between neighbouring conductors, seen from above. Where it is given, the height over them is "
        "measured, and follow_lines holds height_over_line_m; it never sinks below where it began.",
    )
    leash_m: float = Field(4.0, gt=0, le=20, description="The setpoint never runs further ahead of the vehicle.")
    arrival_m: float = Field(0.6, gt=0, le=5, description="The vehicle is there when it is this near.")
    max_estimate_age_s: float = Field(0.5, gt=0, le=5, description="Older estimates do not steer.")


WayDown = Literal["land_clear", "return", "land"]
Pause = Literal["hold", "climb_and_hold"]


class Reactions(_Section):
    """What to do about each hazard.

    hold: stay on the spot until it is over, for hold_limit_s at most. climb_and_hold: the same, higher up. search: see
    line_search. return: the autopilot's return mode, which lands at the take-off point. land: land right here.
    land_clear: land here, but return when the line may be below. continue: note it and go on.
    """

    interrupted: WayDown = Field("land_clear", description="Ctrl-C or SIGTERM: hold, then this.")
    line_lost: Literal[WayDown, Pause, "search", "continue"] = "search"
    vision_dead: Literal[WayDown, Pause] = "return"
    camera_gone: Literal[WayDown, Pause, "continue"] = "hold"
    camera_blind: Literal[WayDown, Pause, "continue"] = Field("hold", description="Dark, frozen or unreadable frames.")
    estimate_stale: Literal[WayDown, Pause, "continue"] = "hold"
    task_timed_out: WayDown = "return"
    task_failed: WayDown = Field("return", description="For example: move_until found no line.")
    geofence: WayDown = "return"
    battery_low: Literal[WayDown, "continue"] = "return"
    battery_critical: WayDown = "land_clear"
    position_bad: Literal[WayDown, Pause] = Field("hold", description="The autopilot's own failsafe follows.")
    tracking_error: Literal[WayDown, Pause, "continue"] = Field(
        "return", description="The vehicle does not follow its setpoints, or tilts too far: too much wind."
    )
    guard_dead: Literal[WayDown, "continue"] = Field("return", description="Nothing watches the control loop any more.")
    cpu_overload: Literal[WayDown, Pause, "continue"] = "return"
    tick_late: Literal[WayDown, Pause, "continue"] = "continue"
    disk_full: Literal[WayDown, "continue"] = "continue"
    log_failing: Literal[WayDown, "continue"] = "continue"
    mission_changed: Literal[WayDown, "continue"] = Field(
        "continue", description="The file on disk is another than the one that is flown."
    )


class LineSearchPlan(_Section):
    """How a lost line is searched for: hold, climb, sweep in yaw, go back along the flown way, sweep again."""

    climb_m: float = Field(3.0, ge=0, le=20, description="Also for climb_and_hold; never above the fence.")
    sweep_deg: float = Field(40.0, ge=0, le=90, description="Turn so far to both sides.")
    back_m: float = Field(20.0, ge=0, le=200, description="At most so far back to where the line was last seen.")
    n_detections: int = Field(4, ge=1, le=100, description="Frames in a row that find the line again.")
    time_limit_s: TimeLimitS = Field(120.0, description="A search that takes longer has found nothing.")


class SafetyPlan(_Section):
    """Limits of the flight, and what happens at them."""

    max_distance_m: float = Field(150.0, gt=0, le=2000, description="Radius of the fence around the take-off point.")
    max_altitude_m: AltitudeM = Field(60.0, description="Height of the fence above the take-off point.")
    fence: FencePlan = FencePlan()
    line_height_m: float | None = Field(
        None, gt=0, le=110, description="Top of the line, wires and poles, above the take-off point; else not checked."
    )
    min_clearance_m: float = Field(3.0, gt=0, le=50, description="Room to keep above line_height_m.")
    line_lost_s: float = Field(
        3.0, gt=0, le=60, description="No estimate for so long while following: the line is lost."
    )
    line_search: LineSearchPlan = LineSearchPlan()
    estimate_stale_s: float = Field(1.0, gt=0, le=10, description="No frame through vision for so long.")
    telemetry_stale_s: float = Field(1.5, gt=0, le=10)
    position_bad_s: float = Field(1.5, gt=0, le=10, description="No good position for so long.")
    hold_limit_s: float = Field(20.0, gt=0, le=600, description="A pause that lasts longer ends in land_clear.")
    min_disk_mb: float = Field(200.0, ge=0, le=1e6, description="Less space than this for the log is a hazard.")
    battery_low_percent: float = Field(25.0, ge=5, le=90)
    battery_critical_percent: float = Field(12.0, ge=2, le=90)
    reactions: Reactions = Reactions()

    @model_validator(mode="after")
    def _fence_has_room(self) -> Self:
        least_m = self.fence.min_altitude_m
        if least_m is not None and least_m >= self.max_altitude_m:
            raise PydanticCustomError(
                "fence_room", "fence.min_altitude_m below max_altitude_m = {high}", {"high": f"{self.max_altitude_m:g}"}
            )
        return self

    @model_validator(mode="after")
    def _critical_is_below_low(self) -> Self:
        if self.battery_critical_percent >= self.battery_low_percent:
            raise PydanticCustomError(
                "battery_order",
                "battery_critical_percent below battery_low_percent = {low}",
                {"low": f"{self.battery_low_percent:g}"},
            )
        return self


class MissionPlan(_Section):
    """A mission file: https://json-schema.org of it stands in missions/mission.schema.json."""

    version: Literal[1] = Field(description="The version of this format.")
    name: str = Field(pattern=r"^[a-z][a-z0-9_]{0,63}$", description="Lower-case letters, digits and underscores.")
    description: str = Field("", max_length=2000)
    tasks: list[TaskPlan] = Field(min_length=1, max_length=200)
    vehicle: VehiclePlan = VehiclePlan()
    camera: CameraPlan = CameraPlan()
    vision: VisionPlan = VisionPlan()
    guidance: GuidancePlan = GuidancePlan()
    safety: SafetyPlan = SafetyPlan()
