"""Guidance: from an estimate and the vehicle's state to the next setpoint. Pure functions.

Frames: NED world; the level frame has its origin in the camera, x forward along the vehicle's heading, y right, z down.
"""

import math
from dataclasses import dataclass, replace

from drivers.camera.camera import Intrinsics
from mission.autopilot import Setpoint, VehicleState
from vision.records import ImageLine, wrap_line_angle_rad


def wrap_angle_rad(angle_rad: float) -> float:
    """Wrap an angle of period 2 pi into (-pi, pi] [rad]."""
    wrapped = math.fmod(angle_rad, math.tau)
    if wrapped <= -math.pi:
        wrapped += math.tau
    elif wrapped > math.pi:
        wrapped -= math.tau
    return wrapped


def nearest_heading_rad(line_heading_rad: float, heading_rad: float) -> float:
    """Of a line's two headings the one nearest to `heading_rad`, in (-pi, pi] [rad]."""
    return wrap_angle_rad(heading_rad + wrap_line_angle_rad(line_heading_rad - heading_rad))


@dataclass(frozen=True, slots=True)
class GuidanceSettings:
    """The plan's guidance section in the program's units; r, P, epsilon and theta_0 are [Ceron]'s.

    `theta_0_rad` None: the yaw at the start.
    """

    is_centred: bool
    r_m_s: float
    P_per_s: float
    epsilon_rad: float
    theta_0_rad: float | None
    climb_m_s: float
    descend_m_s: float
    yaw_rate_rad_s: float
    lateral_per_s: float
    lateral_max_m_s: float
    lateral_lead: float
    height_over_line_m: float
    conductor_spacing_m: float | None
    leash_m: float
    arrival_m: float
    max_estimate_age_s: float


@dataclass(frozen=True, slots=True)
class WorldLine:
    """The line group on the map: its heading [rad] in (-pi, pi] (either of the two) and a point on it [m], NE."""

    heading_rad: float
    north_m: float
    east_m: float

    def offset_m(self, north_m: float, east_m: float, heading_rad: float) -> float:
        """How far the line lies to the right of a point, for one who looks along `heading_rad` [m]."""
        along = nearest_heading_rad(self.heading_rad, heading_rad)
        return -math.sin(along) * (self.north_m - north_m) + math.cos(along) * (self.east_m - east_m)

    def beside(self, right_m: float) -> "WorldLine":
        """The line that runs `right_m` to the right of this one, for one who looks along its heading."""
        return WorldLine(
            self.heading_rad,
            self.north_m - math.sin(self.heading_rad) * right_m,
            self.east_m + math.cos(self.heading_rad) * right_m,
        )

    def meeting_m(self, other: "WorldLine", north_m: float, east_m: float) -> float:
        """How far from a place this line and another one meet [m]; infinite for parallel ones."""
        sine = math.sin(other.heading_rad - self.heading_rad)
        if abs(sine) < 1e-6:
            return math.inf
        d_north_m, d_east_m = other.north_m - self.north_m, other.east_m - self.east_m
        along_m = (d_north_m * math.sin(other.heading_rad) - d_east_m * math.cos(other.heading_rad)) / sine
        meeting_north_m = self.north_m + along_m * math.cos(self.heading_rad)
        meeting_east_m = self.east_m + along_m * math.sin(self.heading_rad)
        return math.hypot(meeting_north_m - north_m, meeting_east_m - east_m)

    def crossing_m(
        self, north_m: float, east_m: float, heading_rad: float, least_rad: float = math.radians(20.0)
    ) -> float | None:
        """How far ahead a ray from the point along `heading_rad` crosses the line [m].

        None where it runs along it, within `least_rad`.
        """
        sine = math.sin(self.heading_rad - heading_rad)
        if abs(sine) < math.sin(least_rad):
            return None
        d_north_m, d_east_m = self.north_m - north_m, self.east_m - east_m
        return (d_north_m * math.sin(self.heading_rad) - d_east_m * math.cos(self.heading_rad)) / sine


@dataclass(frozen=True, slots=True)
class Bearing:
    """Where a line is, seen from the vehicle: its heading [rad] and its slope.

    For one who looks along the heading it passes abreast of the vehicle `slope` metres to the right for each metre that
    it lies below: one camera cannot tell the height.
    """

    heading_rad: float
    slope: float

    def along(self, heading_rad: float) -> "Bearing":
        """The same line, for one who looks along its other heading where that is nearer to `heading_rad`."""
        nearest_rad = nearest_heading_rad(self.heading_rad, heading_rad)
        return Bearing(nearest_rad, self.slope * math.copysign(1.0, math.cos(nearest_rad - self.heading_rad)))

    def line(self, north_m: float, east_m: float, depth_m: float) -> WorldLine:
        """The line on the map, `depth_m` below a vehicle at this place; its point is the one abreast of the vehicle."""
        return WorldLine(self.heading_rad, north_m, east_m).beside(self.slope * depth_m)


def bearing_of(image_line: ImageLine, at_capture: VehicleState, camera: Intrinsics) -> Bearing | None:
    """Where a line of the image is, seen from the vehicle, undoing the vehicle's tilt.

    The camera looks along the body's down axis, image up is the body's forward. Two points of the image line become
    rays, are turned by roll and pitch into the level frame and meet a level plane there. `at_capture` is the vehicle's
    state when the frame was taken, so that the delay of vision does not steer. None where a ray does not look down
    (more than 80 degrees from it).
    """
    sine, cosine = math.sin(image_line.angle_rad), math.cos(image_line.angle_rad)
    foot_px = (image_line.offset_px * cosine, image_line.offset_px * sine)  # along the right-hand normal
    reach_px = 0.25 * camera.height_px
    points = []
    for along_px in (-reach_px, reach_px):
        u_px = foot_px[0] + along_px * sine + (camera.width_px - 1) / 2 - camera.cx_px
        v_px = foot_px[1] - along_px * cosine + (camera.height_px - 1) / 2 - camera.cy_px
        level = _level_from_body(
            -v_px / camera.fy_px, u_px / camera.fx_px, 1.0, at_capture.roll_rad, at_capture.pitch_rad
        )
        if level[2] < math.cos(math.radians(80.0)) * math.hypot(*level):
            return None
        points.append((level[0] / level[2], level[1] / level[2]))
    (x0, y0), (x1, y1) = points
    bearing_rad = math.atan2(y1 - y0, x1 - x0)
    slope = -math.sin(bearing_rad) * x0 + math.cos(bearing_rad) * y0
    return Bearing(wrap_angle_rad(at_capture.yaw_rad + bearing_rad), slope)


def _level_from_body(
    forward: float, right: float, down: float, roll_rad: float, pitch_rad: float
) -> tuple[float, float, float]:
    """Turn a body (FRD) vector into the level frame: R_y(pitch) R_x(roll)."""
    y = math.cos(roll_rad) * right - math.sin(roll_rad) * down
    z_rolled = math.sin(roll_rad) * right + math.cos(roll_rad) * down
    x = math.cos(pitch_rad) * forward + math.sin(pitch_rad) * z_rolled
    z = -math.sin(pitch_rad) * forward + math.cos(pitch_rad) * z_rolled
    return x, y, z


def turn_towards_rad(angle_rad: float, target_rad: float, gain_per_s: float, max_rad_s: float, dt_s: float) -> float:
    """One step of `angle <- angle + error P` ([Ceron] Algorithm 6.2), P per second, at most `max_rad_s` [rad]."""
    error_rad = wrap_angle_rad(target_rad - angle_rad)
    share = 1.0 - math.exp(-gain_per_s * dt_s)  # the same turn whatever the control rate
    return wrap_angle_rad(angle_rad + _clamp(error_rad * share, max_rad_s * dt_s))


def step_along(reference: Setpoint, heading_rad: float, step_m: float) -> Setpoint:
    """Go x <- x + r cos(theta), y <- y + r sin(theta) ([Ceron] Algorithms 6.1 and 6.3); yaw and height stay."""
    return Setpoint(
        reference.north_m + step_m * math.cos(heading_rad),
        reference.east_m + step_m * math.sin(heading_rad),
        reference.down_m,
        reference.yaw_rad,
    )


def step_sideways(
    reference: Setpoint,
    line: WorldLine,
    heading_rad: float,
    gain_per_s: float,
    max_m_s: float,
    dt_s: float,
    beyond_m: float = 0.0,
) -> Setpoint:
    """Move the reference towards the line, across `heading_rad`: a share of the offset per second, up to `max_m_s`.

    It settles `beyond_m` [m] beyond the line, to the right of it where positive.
    """
    offset_m = line.offset_m(reference.north_m, reference.east_m, heading_rad) + beyond_m
    share = 1.0 - math.exp(-gain_per_s * dt_s)
    return step_along(reference, heading_rad + math.pi / 2, _clamp(offset_m * share, max_m_s * dt_s))


def step_level_towards(reference: Setpoint, goal: Setpoint, max_m_s: float, dt_s: float) -> Setpoint:
    """Move the reference's place on the map towards the goal's, at most `max_m_s`; yaw and height stay."""
    north_m, east_m = goal.north_m - reference.north_m, goal.east_m - reference.east_m
    distance_m = math.hypot(north_m, east_m)
    share = min(1.0, max_m_s * dt_s / distance_m) if distance_m > 0.0 else 0.0
    return replace(reference, north_m=reference.north_m + share * north_m, east_m=reference.east_m + share * east_m)


def step_vertical(reference: Setpoint, down_m: float, max_m_s: float, dt_s: float) -> Setpoint:
    """Move the reference's height towards `down_m`, at most `max_m_s`."""
    step_m = _clamp(down_m - reference.down_m, max_m_s * dt_s)
    return Setpoint(reference.north_m, reference.east_m, reference.down_m + step_m, reference.yaw_rad)


def leash(reference: Setpoint, state: VehicleState, length_m: float) -> Setpoint:
    """Keep the reference within `length_m` of the vehicle, level and vertically, so that it cannot run away."""
    north_m, east_m = reference.north_m - state.north_m, reference.east_m - state.east_m
    distance_m = math.hypot(north_m, east_m)
    scale = min(1.0, length_m / distance_m) if distance_m > 0.0 else 1.0
    down_m = _clamp(reference.down_m - state.down_m, length_m)
    return Setpoint(
        state.north_m + scale * north_m, state.east_m + scale * east_m, state.down_m + down_m, reference.yaw_rad
    )


def _clamp(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
