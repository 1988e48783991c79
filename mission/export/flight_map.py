"""What of a flight stands on a map of the Earth: the track, the photographs, the events and the line."""

import enum
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mission.autopilot import GlobalPoint
from mission.export.errors import ExportError
from mission.export.frames import photographs
from mission.export.poses import Floats, Track, heading_deg
from mission.geodesy import points_at
from mission.log.reader import Flight, read_flight
from mission.log.task_spans import FOLLOW_TASK, TaskSpan, task_spans
from mission.log.wording import words_of

Facts = dict[str, str | float]

_TRACK_STEP_M = 0.2
_LINE_STEP_M = 1.0


class Kind(enum.StrEnum):
    """What a feature is."""

    TRACK = "track"
    PHOTOGRAPH = "photograph"
    EVENT = "event"
    KNOWN_LINE = "known_line"
    TRUE_LINE = "true_line"


@dataclass(frozen=True, slots=True, eq=False)
class Feature:
    """One thing on the map: a line, or a point where `places` are a single one.

    `places` (n, 3) are WGS-84 latitude, longitude [deg] and altitude above mean sea level [m]; times are Unix [ns],
    None for what has none; `facts` is what else there is to say, units in the names.
    """

    kind: Kind
    name: str
    places: Floats
    begin_ns: int | None = None
    end_ns: int | None = None
    facts: Facts = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class FlightMap:
    """The features of a flight, in the order of Kind."""

    name: str
    features: tuple[Feature, ...]


def read_map(log: Path) -> FlightMap:
    """Map the flight of a log. Raises LogError, and ExportError where its place on Earth, or any state, is unknown."""
    return map_of(read_flight(log))


def map_of(flight: Flight) -> FlightMap:
    """Map a flight. Raises ExportError where its place on Earth is not known, or no state of the vehicle."""
    maker = _MapMaker(flight)
    features = [*maker.track(), *maker.photographs(), *maker.events(), *maker.known_lines(), *maker.true_lines()]
    return FlightMap(flight.mission.name, tuple(features))


def global_origin(flight: Flight) -> GlobalPoint | None:
    """Where on Earth the flight's local frame lies; None where the autopilot did not tell."""
    origin = flight.origin
    return None if origin is None else GlobalPoint(origin.latitude_rad, origin.longitude_rad, origin.altitude_m)


def places_deg(places_ned_m: Floats, origin: GlobalPoint) -> Floats:
    """Places (n, 3) NED [m] as latitude, longitude [deg] and altitude [m] (n, 3)."""
    places = points_at(places_ned_m, origin)
    places[:, :2] = np.degrees(places[:, :2])
    return places


class _MapMaker:
    def __init__(self, flight: Flight) -> None:
        origin = global_origin(flight)
        if origin is None:
            raise ExportError(
                f"{flight.path} cannot be put on a map: KML and GeoJSON need to know where on Earth the local frame "
                "lies, and this log does not tell it; export csv gives the local positions."
            )
        self._flight = flight
        self._origin = origin
        self._offset_ns = flight.mission.unix_minus_flight_ns
        self._track = Track(flight.states)
        self._spans = task_spans(flight)

    def track(self) -> Iterator[Feature]:
        """The flown track, a piece for each task; one piece where no task was flown."""
        for index, span in enumerate(self._spans):
            facts: Facts = {"task": span.task, "result": span.result, "reason": span.reason}
            name = f"{index + 1} {words_of(span.task)}"
            yield self._piece(name, span.start_ns, self._end_ns(span), facts)
        if not self._spans:
            times_ns = self._track.times_ns
            yield self._piece("track", int(times_ns[0]), int(times_ns[-1]), {})

    def photographs(self) -> Iterator[Feature]:
        """The places of the photographs, where they are known."""
        for photograph in photographs(self._flight):
            pose = self._track.at([photograph.t_ns])
            if not pose.is_known[0]:
                continue
            facts: Facts = {
                "heading_deg": heading_deg(pose.attitude_rad[0, 2]),
                "height_m": round(-float(pose.ned_m[0, 2]), 3),
            }
            yield self._point(Kind.PHOTOGRAPH, photograph.name, photograph.t_ns, pose.ned_m, facts)

    def events(self) -> Iterator[Feature]:
        """The events, where the vehicle was then as far as known."""
        for event in self._flight.events:
            facts: Facts = {
                "severity": str(event.severity),
                "message": event.message,
                "reaction": event.reaction,
            }
            place = self._track.at([event.t_ns]).ned_m
            yield self._point(Kind.EVENT, words_of(event.name), event.t_ns, place, facts)

    def known_lines(self) -> Iterator[Feature]:
        """The middle of the line as it was known while following it, where its depth below the vehicle was."""
        for index, span in enumerate(self._spans):
            if span.task != FOLLOW_TASK:
                continue
            fixes = [
                (fix, depth_m)
                for fix in self._flight.fixes
                if span.start_ns <= fix.t_ns <= self._end_ns(span) and fix.is_placed
                for depth_m in (fix.height_m if fix.depth_m is None else fix.depth_m,)
                if depth_m is not None
            ]
            if not fixes:
                continue
            down_m = self._track.at([fix.t_ns for fix, _ in fixes]).ned_m[:, 2]
            places = [
                (fix.north_m, fix.east_m, down + depth_m) for (fix, depth_m), down in zip(fixes, down_m, strict=True)
            ]
            thinned = _thinned(np.array(places), _LINE_STEP_M)
            if len(thinned) >= 2:
                times_ns = (fixes[0][0].t_ns + self._offset_ns, fixes[-1][0].t_ns + self._offset_ns)
                name = f"line as known in {index + 1} {words_of(span.task)}"
                yield Feature(Kind.KNOWN_LINE, name, places_deg(thinned, self._origin), *times_ns)

    def true_lines(self) -> Iterator[Feature]:
        """The simulated conductors."""
        line = self._flight.line
        for index, conductor in enumerate(() if line is None else line.conductors_ned_m):
            if len(conductor) >= 2:
                places = places_deg(np.array(conductor), self._origin)
                yield Feature(Kind.TRUE_LINE, f"conductor {index + 1}", places)

    def _piece(self, name: str, start_ns: int, end_ns: int, facts: Facts) -> Feature:
        times_ns = self._track.times_ns
        within = times_ns[(times_ns > start_ns) & (times_ns < end_ns)]
        flown = self._track.at(np.concatenate([[start_ns], within, [end_ns]])).ned_m
        thinned = _thinned(flown, _TRACK_STEP_M)
        if len(thinned) == 1:  # it stood still; a line has two ends nevertheless
            thinned = flown[[0, -1]]
        places = places_deg(thinned, self._origin)
        return Feature(Kind.TRACK, name, places, start_ns + self._offset_ns, end_ns + self._offset_ns, facts)

    def _point(self, kind: Kind, name: str, t_ns: int, place_ned_m: Floats, facts: Facts) -> Feature:
        return Feature(kind, name, places_deg(place_ned_m, self._origin), t_ns + self._offset_ns, None, facts)

    def _end_ns(self, span: TaskSpan) -> int:
        return self._flight.end_ns if span.end_ns is None else span.end_ns


def _thinned(places_m: Floats, step_m: float) -> Floats:
    """Of a way (n, 3) [m] its two ends, and each place that is at least `step_m` from the last one taken."""
    taken = [0]
    for k in range(1, len(places_m)):
        if np.linalg.norm(places_m[k] - places_m[taken[-1]]) >= step_m:
            taken.append(k)
    if taken[-1] != len(places_m) - 1 and len(taken) > 1:
        taken.append(len(places_m) - 1)
    return places_m[taken]
