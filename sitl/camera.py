"""The simulated camera: looks at the world from where the simulated vehicle truly is."""

import threading
from types import TracebackType
from typing import Self

from drivers.camera.camera import CameraError, Frame, Intrinsics
from drivers.camera.mailbox import Mailbox
from drivers.clock import NS_PER_S, ScaledClock
from sitl.pose import Pose, PoseBlock
from sitl.render.lens import CameraMount
from sitl.render.motion import Motion, Shutter, motion_between
from sitl.render.photographer import Photographer
from sitl.render.renderer import Renderer
from sitl.render.sensor import Optics
from sitl.world.file import WorldError, load_world
from sitl.world.light import LightName

_JOIN_S = 5.0


class SimCamera:
    """A camera on the simulated vehicle; it implements drivers.camera's Camera.

    `world` names the world (sitl.world.load_world), `pose_block` the shared memory that the vehicle writes its pose to.
    Frames come at `rate_hz` of the clock's flight time, as far as the rendering keeps up; those it misses
    count in `seq`. `seed` is that of the sensor's noise, `light`
    the light of the day (None: the world's own). Entering it paints the world and compiles, which takes
    seconds, and raises CameraError when the world or the pose block is not there.
    count in `seq`. `seed` is that of the sensor's noise; `shutter` says how the frames are exposed while the vehicle
    moves; its motion is that from one frame's pose to the next one's. Entering it paints the world and compiles, which
    takes seconds, and raises CameraError when the world or the pose block is not there.
    """

    def __init__(
        self,
        world: str | None,
        pose_block: str,
        clock: ScaledClock,
        intrinsics: Intrinsics,
        rate_hz: float,
        seed: int,
        *,
        mount: CameraMount | None = None,
        optics: Optics | None = None,
        light: LightName | None = None,
        shutter: Shutter | None = None,
    ) -> None:
        self._world = world
        self._pose_block = pose_block
        self._clock = clock
        self._intrinsics = intrinsics
        self._rate_hz = rate_hz
        self._seed = seed
        self._mount = mount
        self._optics = optics
        self._light = light
        self._shutter = shutter
        self._mailbox: Mailbox[Frame] = Mailbox()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def read(self, timeout_s: float) -> Frame | None:
        """Wait for a frame that was not returned before, and return the newest; None after `timeout_s` [s, wall].

        Raises CameraError when the rendering has failed, EOFError once the camera is closed.
        """
        return self._mailbox.get(timeout_s)

    def __enter__(self) -> Self:
        try:
            poses = PoseBlock.attach(self._pose_block)
        except FileNotFoundError as error:
            raise CameraError(
                f"The simulated camera finds no vehicle: there is no pose block '{self._pose_block}' in shared memory; "
                "start the simulated vehicle first."
            ) from error
        try:
            renderer = Renderer(
                load_world(self._world, self._light), self._intrinsics, self._mount, self._optics, self._seed
            )
        except WorldError as error:
            poses.close()
            raise CameraError(str(error)) from error
        self._compile(renderer)
        self._mailbox = Mailbox()
        self._stop.clear()
        self._thread = threading.Thread(
            target=self._grab, args=(Photographer(renderer, self._shutter), poses), name="sim-camera", daemon=True
        )
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        if self._thread is not None:
            self._thread.join(_JOIN_S)
            self._thread = None
        self._mailbox.close()

    def _compile(self, renderer: Renderer) -> None:
        """Take a picture that is blurred and one that is not, before time counts."""
        pose = Pose(0, 0.0, 0.0, -1.0, (1.0, 0.0, 0.0, 0.0))
        for speed_m_s in (0.0, 100.0):
            Photographer(renderer, self._shutter).take(Motion(pose, (speed_m_s, 0.0, 0.0)), 0)

    def _grab(self, photographer: Photographer, poses: PoseBlock) -> None:
        """Take a frame at each frame time that is not over yet; runs in the grabber thread until told to stop."""
        period_ns = NS_PER_S / self._rate_hz
        start_ns = self._clock.now_ns()
        seq = 0
        motion: Motion | None = None
        try:
            while True:
                early_s = (start_ns + seq * period_ns - self._clock.now_ns()) / NS_PER_S
                if self._stop.wait(self._clock.wall_s(early_s)):
                    return
                pose = poses.read()
                if pose is not None:
                    if motion is None or pose.t_ns != motion.pose.t_ns:  # the same pose again tells nothing new
                        motion = motion_between(None if motion is None else motion.pose, pose)
                    image = photographer.take(motion, seq).image
                    image.flags.writeable = False
                    self._mailbox.put(Frame(seq, pose.t_ns, image))
                seq = max(seq + 1, int((self._clock.now_ns() - start_ns) / period_ns) + 1)
        except Exception as error:
            # Whatever went wrong in this thread, the reader must hear of it rather than wait for frames for ever.
            self._mailbox.close(CameraError(f"The simulated camera broke down while rendering: {error!r}."))
        finally:
            poses.close()
