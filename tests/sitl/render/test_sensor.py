"""The sensor exposes, amplifies, is noisy and blinded as light and gain say."""

import dataclasses
import math

import numpy as np
import pytest
from numpy.typing import NDArray

from sitl.pose import Pose
from sitl.render.exposure import SUNNY, SUNNY_S, AutoExposure, Exposure, ExposureMeter
from sitl.render.glare import add_glare, find_glare, sample, small_rays
from sitl.render.lens import DOWN, FRONT, camera_pose, pinhole, ray_table
from sitl.render.motion import Motion, Shutter
from sitl.render.photographer import Photographer
from sitl.render.renderer import Renderer
from sitl.render.sensor import Optics, Sensor
from sitl.world.file import load_world
from sitl.world.records import World

CAMERA = pinhole(320, 240, math.radians(80.0))
RAYS = ray_table(CAMERA)
NO_SUN = np.zeros(3)
MS_NS = 1_000_000


def even(level: float) -> NDArray[np.float32]:
    return np.full((240, 320, 3), level, dtype=np.float32)


def linear(image: NDArray[np.uint8]) -> NDArray[np.float64]:
    v = image.astype(np.float64) / 255.0
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def noise_of(level: float, exposure: Exposure, optics: Optics) -> float:
    """The standard deviation of the signal of an even light."""
    return float(linear(Sensor(RAYS, optics, 1).expose(even(level), exposure, 0, NO_SUN)).std())


@pytest.mark.parametrize("gain", [1.0, 4.0, 16.0])
def test_noise_grows_as_fewer_photons_are_amplified(gain: float) -> None:
    """The same brightness from a `gain`th of the light: shot noise by the root of the gain, read noise by the gain."""
    plain = {"blur_px": 0.0, "corner_light": 1.0}
    exposure = Exposure(SUNNY_S, gain)
    shot = noise_of(0.4 / gain, exposure, Optics(read_noise=0.0, shot_noise=0.018, **plain))
    assert shot == pytest.approx(0.018 * math.sqrt(0.4) * math.sqrt(gain), rel=0.03)
    read = noise_of(0.4 / gain, exposure, Optics(read_noise=0.005, shot_noise=0.0, **plain))
    assert read == pytest.approx(0.005 * gain, rel=0.06)  # 8 bits are coarse here


def test_more_light_makes_more_noise_and_less_of_it_in_proportion() -> None:
    optics = Optics(blur_px=0.0, corner_light=1.0, read_noise=0.0)
    dark, bright = noise_of(0.1, SUNNY, optics), noise_of(0.6, SUNNY, optics)
    assert bright / dark == pytest.approx(math.sqrt(6.0), rel=0.03)


def dusk() -> World:
    """The dusk's little light, from where the sun stands at noon: its long shadows take long to paint."""
    world = load_world()
    return dataclasses.replace(world, light=dataclasses.replace(world.light, direct=0.012, sky=0.03))


@pytest.mark.parametrize("world", [load_world(), dusk()], ids=["noon", "dusk"])
def test_every_light_comes_out_as_bright_as_noon(world: World) -> None:
    renderer = Renderer(world, CAMERA)
    shot = Photographer(renderer).take(Motion(Pose(0, 11.3, 4.1, -16.0, (1.0, 0.0, 0.0, 0.0))), 0)
    assert 80.0 < shot.image.mean() < 110.0
    level = renderer.light(Pose(0, 11.3, 4.1, -16.0, (1.0, 0.0, 0.0, 0.0))).mean()
    assert shot.exposure.scale * level == pytest.approx(0.16, abs=0.03)


def test_time_comes_before_gain_and_both_have_limits() -> None:
    automatic = AutoExposure()
    assert automatic.split(1.0) == SUNNY
    assert automatic.split(1e-6) == Exposure(automatic.shortest_s)
    longest = automatic.longest_s / SUNNY_S
    assert automatic.split(3.0 * longest) == Exposure(automatic.longest_s, pytest.approx(3.0))
    assert automatic.split(1e6) == Exposure(automatic.longest_s, automatic.most_gain)


def test_a_step_in_the_light_is_followed_over_its_time_constant() -> None:
    """A step down by 4 is down to its 1 / e after the time constant, as a ratio, at any frame rate."""
    for n_frames in (3, 15):
        meter = ExposureMeter()
        before = meter.settle(even(0.4), 0)
        after = meter.follow(even(0.1), 0)
        for k in range(n_frames):
            after = meter.follow(even(0.1), round((k + 1) * 150 / n_frames * MS_NS))
        left = 0.18 / 0.1 / after.scale
        assert math.log(left) / math.log(4.0) == pytest.approx(math.exp(-1.0), abs=0.002)
        assert before.scale == pytest.approx(0.18 / 0.4, rel=1e-3)


def test_a_dazzled_camera_recovers_and_one_in_the_dark_does_not_run_away() -> None:
    meter = ExposureMeter()
    meter.settle(even(0.001), 0)
    for k in range(120):
        meter.follow(even(1.0), k * 33 * MS_NS)
    assert meter.exposure is not None
    assert meter.exposure.scale == pytest.approx(0.18, rel=0.02)
    for k in range(2):
        meter.follow(even(0.0), (10_000 + 1_000 * k) * MS_NS)
    assert meter.exposure == Exposure(0.008, 16.0)


def test_the_same_frames_give_the_same_exposures() -> None:
    def fly() -> list[Exposure]:
        photographer = Photographer(Renderer(load_world(), CAMERA))
        poses = [Pose(k * 33 * MS_NS, 0.5 * k, 0.0, -3.0 - k, (1.0, 0.0, 0.0, 0.0)) for k in range(6)]
        return [photographer.take(Motion(pose), k).exposure for k, pose in enumerate(poses)]

    first = fly()
    assert first == fly()
    assert len(set(first)) > 3


def test_a_fixed_time_leaves_the_gain_to_the_automatic() -> None:
    renderer = Renderer(dusk(), CAMERA)
    pose = Pose(0, 11.3, 4.1, -16.0, (1.0, 0.0, 0.0, 0.0))
    shot = Photographer(renderer, Shutter(exposure_s=0.002)).take_alone(Motion(pose), 0)
    assert shot.exposure.time_s == 0.002
    assert 2.0 < shot.exposure.gain < 8.0


@pytest.mark.parametrize(
    ("name", "value"),
    [("target", 0.0), ("shortest_s", 0.0), ("shortest_s", 0.01), ("most_gain", 0.5), ("time_constant_s", 0.0)],
)
def test_an_impossible_automatic_is_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match="automatic"):
        AutoExposure(**{name: value})


def sun_at(x: float, y: float, bright: float) -> NDArray[np.float64]:
    ray = np.array([x, y, 1.0])
    return bright * ray / np.linalg.norm(ray)


def test_the_sun_dazzles_where_it_stands_and_veils_the_rest() -> None:
    """Brightest at its own place, fainter away from it; from beside the picture it still veils; from behind, not."""
    sensor = Sensor(RAYS, Optics(), 1)
    inside = linear(sensor.expose(even(0.1), SUNNY, 0, sun_at(0.4, -0.2, 0.5))).mean(axis=2)
    v, u = np.unravel_index(np.argmax(inside), inside.shape)
    f_px = CAMERA.fx_px
    assert (u, v) == (pytest.approx(159.5 + 0.4 * f_px, abs=12), pytest.approx(119.5 - 0.2 * f_px, abs=12))
    plain = linear(sensor.expose(even(0.1), SUNNY, 0, NO_SUN)).mean(axis=2)
    assert inside.max() == 1.0
    assert (inside - plain)[200:, :40].mean() > 0.0005
    beside = linear(sensor.expose(even(0.1), SUNNY, 0, sun_at(1.2, 0.0, 0.5))).mean(axis=2)
    assert (beside - plain)[:, 280:].mean() > 3.0 * (beside - plain)[:, :40].mean() > 0.0
    behind = sensor.expose(even(0.1), SUNNY, 0, np.array([0.0, 0.1, -0.5]))
    np.testing.assert_array_equal(behind, sensor.expose(even(0.1), SUNNY, 0, NO_SUN))


def test_what_is_far_over_white_has_a_halo() -> None:
    light = even(0.1)
    light[100:140, 140:180] = 8.0
    glare = find_glare(sample(light), 1.0, small_rays(RAYS), NO_SUN)
    assert glare is not None
    halo = add_glare(even(0.0), glare)[:, :, 1]
    assert halo[120, 190] > 3.0 * halo[120, 300] > 0.0
    assert halo.max() < 1.0
    assert find_glare(sample(even(0.9)), 1.0, small_rays(RAYS), NO_SUN) is None
    assert Sensor(RAYS, Optics(has_glare=False), 1).glare(light, SUNNY, NO_SUN) is None


@pytest.mark.parametrize("size_px", [(320, 240), (321, 243), (37, 21), (3, 3)])
def test_glare_lies_where_its_source_is_in_a_picture_of_any_size(size_px: tuple[int, int]) -> None:
    camera = pinhole(*size_px, math.radians(80.0))
    light = np.full((size_px[1], size_px[0], 3), 0.1, dtype=np.float32)
    image = Sensor(ray_table(camera), Optics(blur_px=0.0), 1).expose(light, SUNNY, 0, sun_at(0.0, 0.0, 0.5))
    assert image.shape == light.shape
    assert np.all(light == np.float32(0.1))  # a light that is not blurred is the caller's


def test_the_front_camera_looks_ahead_and_20_degrees_down() -> None:
    pose = Pose(0, 1.0, 2.0, -3.0, (1.0, 0.0, 0.0, 0.0))
    centre, ned_from_camera = camera_pose(pose, FRONT)
    down = math.radians(20.0)
    assert ned_from_camera[:, 2] == pytest.approx([math.cos(down), 0.0, math.sin(down)])
    assert ned_from_camera[:, 0] == pytest.approx([0.0, 1.0, 0.0])
    assert ned_from_camera[2, 1] > 0.9  # image down is down
    assert centre[0] > 1.0
    assert camera_pose(pose, DOWN)[1][:, 2] == pytest.approx([0.0, 0.0, 1.0])
