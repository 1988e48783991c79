"""`lineflight world render | dataset | replay`: pictures of simulated worlds with their truth, videos of flights."""

import math
import sys
from pathlib import Path
from typing import Annotated, Literal

import typer

from mission.ending import refuse, tell_flaws
from mission.fly_commands import LightName

app = typer.Typer(help="Take pictures of simulated worlds.", no_args_is_help=True)

# sitl.render.truth.sampling.CameraName, without its import
CameraChoice = Literal["down", "front"]

SizeOption = Annotated[str, typer.Option(help="WIDTHxHEIGHT in pixels.")]
HfovOption = Annotated[float, typer.Option(min=10.0, max=150.0, help="Horizontal field of view in degrees.")]


@app.command()
def render(
    world: Annotated[str, typer.Argument(help="A world's name or file.")],
    pose: Annotated[
        str, typer.Option(help="NORTH,EAST,DOWN,YAW[,PITCH,ROLL] in m and degrees; 16 m over the start is 0,0,-16,0.")
    ],
    camera: Annotated[CameraChoice, typer.Option(help="Straight down, or ahead and 20 degrees down.")] = "down",
    out: Annotated[Path, typer.Option(help="The PNG file to write.")] = Path("picture.png"),
    truth: Annotated[
        bool, typer.Option("--truth", help="Write _mask.png, _depth.png (mm), _lines.json and _boxes.json beside it.")
    ] = False,
    light: Annotated[LightName | None, typer.Option(help="Instead of the world's own.")] = None,
    size: SizeOption = "640x480",
    hfov: HfovOption = 80.0,
) -> None:
    """Take one picture of a world, from a pose."""
    width_px, height_px = _size(size)
    numbers = _pose(pose)
    if out.suffix.lower() != ".png":
        refuse(f"--out is '{out}'; name a file that ends in .png.")
    from mission.simulated.pictures import PicturesError, picture_camera, render_picture, write_picture_files
    from mission.simulated.simulation import WorldError

    try:
        image, found = render_picture(world, light, numbers, camera, picture_camera(width_px, height_px, hfov))
        written = write_picture_files(out, image, found if truth else None)
    except (WorldError, PicturesError) as error:
        refuse(str(error))
    for file in written:
        typer.echo(file)


@app.command()
def dataset(
    world: Annotated[str, typer.Argument(help="A world's name or file.")],
    out: Annotated[Path, typer.Option(help="The folder to make; it must be empty.")],
    n: Annotated[int, typer.Option("--n", min=1, max=1_000_000, help="How many pictures.")] = 500,
    seed: Annotated[int, typer.Option(min=0, help="Seed of places, motion and noise.")] = 1,
    camera: Annotated[
        Literal["down", "front", "both"], typer.Option(help="Straight down, ahead and 20 degrees down, or by turns.")
    ] = "both",
    light: Annotated[
        Literal["noon", "low_sun", "overcast", "dusk", "random"] | None,
        typer.Option(help="Instead of the world's own; random: another for each picture."),
    ] = None,
    labels: Annotated[
        Literal["coco", "yolo", "both"], typer.Option("--format", help="instances.json, labels/*.txt, or both.")
    ] = "both",
    images: Annotated[Literal["jpg", "png"], typer.Option(help="The images' format.")] = "jpg",
    size: SizeOption = "640x480",
    hfov: HfovOption = 80.0,
) -> None:
    """Take many pictures along a world's line, with masks, depth, labels and poses, for training and for measuring."""
    width_px, height_px = _size(size)
    from rich.console import Console
    from rich.progress import Progress

    from mission.simulated.pictures import DatasetSettings, PicturesError, make_dataset
    from mission.simulated.simulation import WorldError, world_path_or_name

    settings = DatasetSettings(
        world=world_path_or_name(world) or world,
        out=out,
        n=n,
        seed=seed,
        cameras=("down", "front") if camera == "both" else (camera,),
        light=light,
        labels=labels,
        width_px=width_px,
        height_px=height_px,
        hfov_rad=math.radians(hfov),
        is_jpeg=images == "jpg",
    )
    try:
        with Progress(console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty()) as progress:
            task = progress.add_task("pictures", total=n)
            make_dataset(settings, lambda: progress.advance(task))
    except (WorldError, PicturesError) as error:
        refuse(str(error))
    typer.echo(f"{out}: {n} pictures")


@app.command()
def replay(
    log: Annotated[Path, typer.Argument(help="A flight log (.mcap).")],
    out: Annotated[Path | None, typer.Option(help="The video to write (.mp4); else beside the log.")] = None,
    camera: Annotated[Literal["down", "front", "both"], typer.Option(help="Which way to look.")] = "down",
    world: Annotated[str | None, typer.Option(help="A world's name or file; else the one that the log names.")] = None,
    light: Annotated[LightName | None, typer.Option(help="Instead of the flight's.")] = None,
    size: Annotated[str | None, typer.Option(help="WIDTHxHEIGHT in pixels; else as flown.")] = None,
) -> None:
    """Make a video of a flight: its poses rendered again, with the lines found, the task and a map."""
    size_px = None if size is None else _size(size)
    from mission.log.errors import LogError
    from mission.log.reader import read_flight
    from mission.simulated.pictures import PicturesError
    from mission.simulated.simulation import WorldError

    file = log.with_suffix(".mp4") if out is None else out
    if file.suffix.lower() != ".mp4":
        refuse(f"--out is '{file}'; name a file that ends in .mp4.")
    try:
        flight = read_flight(log)
        tell_flaws(log, flight.flaws)
        from rich.console import Console
        from rich.progress import Progress

        from mission.simulated.replay import world_of, write_video

        scene = world_of(flight, world, light)
        with Progress(console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty()) as progress:
            task = progress.add_task("frames", total=None)
            n_frames = write_video(
                flight,
                scene,
                file,
                camera,
                size_px,
                lambda done, total: progress.update(task, completed=done, total=total),
            )
    except WorldError as error:
        refuse(f"{error} Name the flight's with --world." if world is None else str(error))
    except (LogError, PicturesError) as error:
        refuse(str(error))
    typer.echo(f"{file}: {n_frames} frames")


def _size(text: str) -> tuple[int, int]:
    first, _, second = text.lower().partition("x")
    numbers = [int(word) if word.isascii() and word.isdecimal() else 0 for word in (first, second)]
    if not 16 <= min(numbers) <= max(numbers) <= 8192:
        refuse(f"--size is '{text}'; write two numbers from 16 to 8192, as in --size 640x480.")
    return numbers[0], numbers[1]


def _pose(text: str) -> list[float]:
    """North, east, down [m], yaw, pitch and roll [degrees]."""
    try:
        numbers = [float(word) for word in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (4, 6) or not all(math.isfinite(number) and abs(number) < 1e6 for number in numbers):
        refuse(
            f"--pose is '{text}'; write north, east and down in m and yaw in degrees, and pitch and roll if they are "
            "not 0, as in --pose 11,4,-16,110."
        )
    return [*numbers, 0.0, 0.0][:6]


if __name__ == "__main__":
    app()
