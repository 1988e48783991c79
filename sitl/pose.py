"""The simulated vehicle's true pose, shared between processes without locks.

The vehicle's process writes, the simulated camera and the log's ground truth read. A sequence counter that is odd while
a write is under way tells a reader to look again (a seqlock), so that the writer never waits.
"""

import math
from dataclasses import dataclass
from multiprocessing import shared_memory
from typing import Self

import numpy as np

_MAX_LOOKS = 100  # a write takes far less; a writer that died within one would keep the counter odd for ever
_N_FIELDS = 8  # t_ns, north, east, down, qw, qx, qy, qz


@dataclass(frozen=True, slots=True)
class Pose:
    """True pose: flight time [ns], position NED [m] from the world's origin, quaternion (w, x, y, z) ned_from_frd."""

    t_ns: int
    north_m: float
    east_m: float
    down_m: float
    quaternion: tuple[float, float, float, float]

    @property
    def yaw_rad(self) -> float:
        """Heading from north, clockwise positive [rad], (-pi, pi]."""
        w, x, y, z = self.quaternion
        return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


class PoseBlock:
    """A pose in shared memory. One process creates and writes it, any number attach by `name` and read."""

    def __init__(self, memory: shared_memory.SharedMemory, *, is_owner: bool) -> None:
        self._memory = memory
        self._is_owner = is_owner
        self._last: Pose | None = None
        self._sequence = np.ndarray((1,), dtype=np.int64, buffer=memory.buf)
        self._t_ns = np.ndarray((1,), dtype=np.int64, buffer=memory.buf, offset=8)
        self._fields = np.ndarray((_N_FIELDS - 1,), dtype=np.float64, buffer=memory.buf, offset=16)

    @classmethod
    def create(cls) -> Self:
        """Create the block; its `name` is what the others attach to."""
        memory = shared_memory.SharedMemory(create=True, size=8 * (_N_FIELDS + 1))
        block = cls(memory, is_owner=True)
        block._sequence[0] = 0
        return block

    @classmethod
    def attach(cls, name: str) -> Self:
        """Attach to an existing block, in the owner's process or a child of it.

        Raises FileNotFoundError when there is none of that name.
        """
        return cls(shared_memory.SharedMemory(name=name), is_owner=False)

    @property
    def name(self) -> str:
        """The block's name in shared memory."""
        return self._memory.name

    def write(self, pose: Pose) -> None:
        """Publish a pose."""
        self._sequence[0] += 1
        self._t_ns[0] = pose.t_ns
        self._fields[:] = (pose.north_m, pose.east_m, pose.down_m, *pose.quaternion)
        self._sequence[0] += 1

    def read(self) -> Pose | None:
        """The newest pose; None before the first.

        While a write does not come to its end, the last pose that was read here, or None if none was.
        """
        for _ in range(_MAX_LOOKS):
            before = int(self._sequence[0])
            if before == 0:
                return None
            if before % 2 == 0:
                t_ns = int(self._t_ns[0])
                north_m, east_m, down_m, w, x, y, z = self._fields.tolist()
                if int(self._sequence[0]) == before:
                    self._last = Pose(t_ns, north_m, east_m, down_m, (w, x, y, z))
                    break
        return self._last

    def close(self) -> None:
        """Let go of the block; the owner's close ends it."""
        del self._sequence, self._t_ns, self._fields
        self._memory.close()
        if self._is_owner:
            self._memory.unlink()
