"""`lineflight camera`: which cameras there are, what one gives, and its calibration."""

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from mission.ending import EXIT_BAD_INPUT, EXIT_FAILED_FILE, fail

if TYPE_CHECKING:
    from drivers.camera.camera import CameraSettings
    from mission.camera_show import Viewing
    from vision.pipeline import VisionSettings

app = typer.Typer(help="List, look through and calibrate cameras.", no_args_is_help=True)

JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]


@app.command("list")
def list_cameras(as_json: JsonOption = False) -> None:
    """Say which V4L2 cameras this computer has, and their largest modes."""
    from drivers.camera.v4l2_device import list_devices

    devices = list_devices()
    if as_json:
        entries = [
            {
                "spec": f"v4l2:{device.path}",
                "name": device.name,
                "driver": device.driver,
                "bus": device.bus,
                "modes": [
                    {"pixel_format": mode.pixel_format, "width": mode.width_px, "height": mode.height_px,
                     "rates_hz": list(mode.rates_hz)}
                    for mode in device.modes
                ],
            }
            for device in devices
        ]  # fmt: skip
        typer.echo(json.dumps(entries))
        return
    if not devices:
        typer.echo("This computer has no V4L2 camera; plug one in.")
        return
    for device in devices:
        typer.echo(f"v4l2:{device.path}  {device.name} ({device.driver}, {device.bus})")
        for mode in device.modes:
            rates = ", ".join(f"{rate:g}" for rate in mode.rates_hz) or "?"
            typer.echo(f"    {mode.pixel_format}  {mode.width_px} x {mode.height_px} px  at {rates} Hz")


@app.command()
def show(
    spec: Annotated[str, typer.Argument(help="v4l2:DEVICE or file:PATH (video, images, flight log).")],
    mission: Annotated[Path | None, typer.Option(help="Take the camera section of this mission file.")] = None,
    size: Annotated[
        str | None, typer.Option(help="WIDTHxHEIGHT in pixels; else the mission's, the recording's, or 640x480.")
    ] = None,
    rate: Annotated[float | None, typer.Option(min=0.1, max=240, help="Frames a second; else 30.")] = None,
    pixel_format: Annotated[str | None, typer.Option(help="YUYV, MJPG, ...; V4L2 alone.")] = None,
    control: Annotated[list[str] | None, typer.Option(help="NAME=VALUE, in this order; V4L2 alone.")] = None,
    seconds: Annotated[float, typer.Option(min=0.1, max=3600, help="How long to look.")] = 2.0,
    still: Annotated[Path | None, typer.Option(help="Draw the last frame, with its lines, to this image.")] = None,
    keep: Annotated[Path | None, typer.Option(help="Keep the last frame as it is, e.g. for a calibration.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Look through a camera for a moment: rate, age and light of its frames, and its controls."""
    from drivers.camera.camera import CameraError
    from drivers.camera.recorded import recording_size_px
    from drivers.camera.spec import open_camera, parse_spec
    from drivers.clock import ScaledClock
    from mission.camera_show import watch, write_image, write_still

    settings, vision = _settings(mission, size, rate, pixel_format, control or [])
    clock = ScaledClock()
    try:
        kind, place = parse_spec(spec)
        if kind == "file" and mission is None and size is None:
            width_px, height_px = recording_size_px(place)
            settings = replace(settings, width_px=width_px, height_px=height_px)
        if kind == "v4l2" and not as_json:
            _print_controls(place)
        seen = watch(open_camera(spec, settings, clock), clock, seconds)
        if seen.last is not None and keep is not None:
            write_image(keep, seen.last.image)
        has_line = None
        if seen.last is not None and still is not None:
            has_line = write_still(still, seen.last, vision)
    except CameraError as error:
        fail(str(error), EXIT_BAD_INPUT)
    _print_viewing(spec, seen, has_line, as_json=as_json)
    if seen.last is None:
        fail(f"The camera {spec} gave no frame.", EXIT_FAILED_FILE)


@app.command()
def calibrate(
    folder: Annotated[Path, typer.Argument(help="Photographs of the board, all of one size.")],
    board: Annotated[str, typer.Option(help="Inner corners of a checkerboard, or squares of a ChArUco board.")] = "9x6",
    charuco: Annotated[bool, typer.Option(help="The board is a ChArUco one (DICT_5X5_1000, markers 3/4).")] = False,
    lens: Annotated[
        Literal["auto", "pinhole", "fisheye"], typer.Option(help="The model; auto takes the better.")
    ] = "auto",
    out: Annotated[Path, typer.Option(help="The calibration file to write.")] = Path("camera.yaml"),
) -> None:
    """Calibrate a camera from photographs of a board, for camera.calibration of a mission file."""
    from drivers.camera.calibration import Board
    from drivers.camera.calibration_file import write_calibration
    from drivers.camera.camera import CameraError
    from mission.camera_show import board_photos, calibrate_from

    columns, rows = _two_numbers(board, "--board", "9x6")

    def tell(file: Path, is_found: bool) -> None:
        typer.echo(f"{file.name}: {'found' if is_found else 'no board'}", err=True)

    try:
        sought = Board(columns, rows, is_charuco=charuco)
        found, views = calibrate_from(board_photos(folder), sought, None if lens == "auto" else lens, tell)
        write_calibration(out, found.intrinsics, found.rms_px, f"{len(views)} photographs of a {sought}")
    except CameraError as error:
        fail(str(error), EXIT_BAD_INPUT)
    worst = max(zip(found.view_rms_px, views, strict=True), key=lambda pair: pair[0])
    camera = found.intrinsics
    typer.echo(f"{camera.lens} lens, {camera.width_px} x {camera.height_px} px")
    typer.echo(f"focal    {camera.fx_px:.1f} x {camera.fy_px:.1f} px, centre {camera.cx_px:.1f}, {camera.cy_px:.1f}")
    typer.echo(
        f"error    {found.rms_px:.2f} px rms over {len(views)} photographs; worst {worst[1].name}: {worst[0]:.2f}"
    )
    typer.echo(f"coverage {found.coverage:.0%} of the frame")
    if found.coverage < 0.6:
        typer.echo("         the lens is only guessed where no corner was: add photographs near the frame's corners")
    typer.echo(f"written  {out}; name it in the mission as camera.calibration")


def _settings(
    mission: Path | None, size: str | None, rate: float | None, pixel_format: str | None, controls: list[str]
) -> "tuple[CameraSettings, VisionSettings]":
    """What the options ask of the camera, over what the mission file says; and how the mission looks at its frames."""
    from drivers.camera.camera import CameraSettings
    from vision.pipeline import VisionSettings

    settings, vision = CameraSettings(640, 480, 30.0), VisionSettings()
    if mission is not None:
        from mission.build import vision_settings
        from mission.live_camera import camera_settings
        from mission.plan_file import MissionFileError, read_mission

        try:
            read = read_mission(mission)
        except MissionFileError as error:
            fail("\n".join(error.lines()), EXIT_BAD_INPUT)
        settings, vision = camera_settings(read.plan.camera), vision_settings(read.plan, read.camera)
    if size is not None:
        width_px, height_px = _two_numbers(size, "--size", "640x480")
        settings, vision = replace(settings, width_px=width_px, height_px=height_px), replace(vision, camera=None)
    if rate is not None:
        settings = replace(settings, rate_hz=rate)
    if pixel_format is not None:
        if len(pixel_format) != 4 or not pixel_format.isascii():
            fail(f"--pixel-format is '{pixel_format}'; write four characters, as in YUYV or MJPG.", EXIT_BAD_INPUT)
        settings = replace(settings, pixel_format=pixel_format)
    if controls:
        settings = replace(settings, controls=tuple(_control(text) for text in controls))
    return settings, vision


def _two_numbers(text: str, option: str, example: str) -> tuple[int, int]:
    first, _, second = text.lower().partition("x")
    numbers = [int(word) if word.isascii() and word.isdecimal() else 0 for word in (first, second)]
    if min(numbers) < 3 or max(numbers) > 20_000:
        fail(f"{option} is '{text}'; write two numbers from 3 on, as in {option} {example}.", EXIT_BAD_INPUT)
    return numbers[0], numbers[1]


def _control(text: str) -> tuple[str, int]:
    name, _, value = text.partition("=")
    try:
        return name, int(value)
    except ValueError:
        fail(f"--control is '{text}'; write a name and a number, as in --control auto_exposure=1.", EXIT_BAD_INPUT)


def _print_controls(device: Path) -> None:
    from drivers.camera.v4l2_device import read_controls

    for control in read_controls(device):
        value = "?" if control.value is None else control.value
        fixed = ", read only" if control.is_read_only else ""
        typer.echo(f"    {control.name} = {value}  ({control.kind}, {control.minimum} to {control.maximum}, "
                   f"default {control.default}{fixed})")  # fmt: skip


def _print_viewing(spec: str, seen: "Viewing", has_line: bool | None, *, as_json: bool) -> None:
    import statistics

    age_ms = statistics.median(seen.ages_ms) if seen.ages_ms else None
    worst_ms = max(seen.ages_ms, default=None)
    if as_json:
        entry = {
            "spec": spec,
            "frames": seen.n_frames,
            "dropped": seen.n_dropped,
            "rate_hz": seen.rate_hz,
            "size": None if seen.last is None else list(seen.last.image.shape[1::-1]),
            "age_ms": {"median": age_ms, "max": worst_ms},
            "level": seen.level,
            "trouble": seen.trouble,
            "power_line": has_line,
        }
        typer.echo(json.dumps(entry))
        return
    if seen.last is None:
        return
    height_px, width_px = seen.last.image.shape[:2]
    rate = "?" if seen.rate_hz is None else f"{seen.rate_hz:.1f}"
    typer.echo(f"{width_px} x {height_px} px at {rate} Hz: {seen.n_frames} frames, {seen.n_dropped} dropped")
    typer.echo(f"age when read {age_ms:.1f} ms in the median, {worst_ms:.1f} ms at most")
    typer.echo(f"light {seen.level:.0f} of 255" + (f"; the frame is {seen.trouble}" if seen.trouble else ""))
    if has_line is not None:
        typer.echo("a power line is in view" if has_line else "no power line is in view")
