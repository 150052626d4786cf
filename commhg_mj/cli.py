"""Missions of human operators, aerial and ground robots under limited communication.

The command line: parses, calls, prints. Bad input exits with 2 and one line that names it.
"""

import contextlib
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Column, Table

from . import SCENARIOS, load_scenario, load_trace
from .mission.batch import check_seed
from .policies import find_policy
from .radio import find_link_model
from .scenarios import describe
from .study.fly import fly, trace_path

Limitation = Literal["nominal", "low", "high"]
OUT = Console(width=None if sys.stdout.isatty() else 160)
LOG = Console(stderr=True)


@dataclass(frozen=True)
class Run:
    """Fly missions and print how they went."""

    scenario: str = "medium"
    """small, medium, large, or a TOML file that overrides one of them"""
    policy: str = "greedy"
    """random, greedy, or omniscient (privileged reference)"""
    seed: int = 0
    """of the first mission; the others count up from it"""
    missions: int = 1
    """how many"""
    limitation: Limitation = "nominal"
    """of communication"""
    links: str = "abstract"
    """link model: abstract, or perfect (free communication, idealised)"""
    workers: int = 1
    """processes"""
    out: Path | None = None
    """folder that gets one trace a mission"""
    video: bool = False
    """also render the first mission (into --out, by default the folder runs)"""
    json: bool = False
    """print one JSON object on standard output and nothing else"""

    def __call__(self):
        from .study.summary import summary_json, summary_table

        scenario = load_scenario(self.scenario)
        privileged = find_policy(self.policy).is_privileged
        find_link_model(self.links)
        _at_least("missions", self.missions, 1)
        _at_least("workers", self.workers, 1)
        check_seed(self.seed)
        check_seed(self.seed + self.missions - 1)
        folder = self.out or (Path("runs") if self.video else None)
        if folder is not None:
            _make_folder(folder)
        seeds = range(self.seed, self.seed + self.missions)
        links = "perfect" if privileged else self.links
        settings = {
            "scenario": scenario.name, "policy": self.policy, "links": links, "limitation": self.limitation,
        }  # fmt: skip
        with _progress("flying", self.missions) as advance:
            scores = fly(scenario, self.policy, seeds, self.links, self.limitation, folder, self.workers, advance)
        if self.json:
            print(summary_json({**settings, "privileged": privileged}, seeds, scores))
        else:
            mark = " (PRIVILEGED REFERENCE: true state)" if privileged else ""
            title = f"{scenario.name}, {self.policy}{mark}, {links} links, {self.limitation} limitation, {self.missions} missions"
            OUT.print(summary_table(title, scores))
        if self.video:
            path = trace_path(folder, scenario, self.policy, self.links, self.limitation, self.seed)
            Render(path, path.with_suffix(".mp4"))(report=LOG)


@dataclass(frozen=True)
class Render:
    """Render a trace to a video, or one moment of it to a picture."""

    trace: tyro.conf.Positional[Path]
    """trace file, from `run --out`"""
    out: Path
    """FILE.mp4, or FILE.png with --at"""
    camera: str = "overview"
    """overview, station, map, orbit or follow:ROBOT, for example follow:uav0"""
    size: str = "1280x720"
    """WIDTHxHEIGHT in pixels"""
    fps: int = 24
    """pictures per second"""
    speed: float = 20.0
    """seconds of the mission per second of video"""
    start: Annotated[float, tyro.conf.arg(name="from")] = 0.0
    """first second"""
    stop: Annotated[float | None, tyro.conf.arg(name="to")] = None
    """last second; by default the end"""
    at: float | None = None
    """the second of a single picture"""
    workers: int = 2
    """processes"""

    def __call__(self, report=OUT):
        _load_mujoco()
        from .render import render_image, render_video

        trace, size = load_trace(self.trace), _parse_size(self.size)
        if self.at is not None:
            render_image(trace, self.out, self.at, self.camera, size)
        else:
            with _progress("rendering", 1) as advance:
                render_video(
                    trace, self.out, self.camera, size, self.fps, self.speed, self.start, self.stop, self.workers,
                    lambda done, total: advance(1 / total),
                )  # fmt: skip
        _say(f"wrote {self.out}", report)


@dataclass(frozen=True)
class Scenarios:
    """Print every field of a scenario with its value, unit and mark: P is the paper's, D our default."""

    name: tyro.conf.Positional[str | None] = None
    """small, medium, large or a TOML file; without it all three"""

    def __call__(self):
        names = [self.name] if self.name else list(SCENARIOS)
        columns = [list(describe(load_scenario(name))) for name in names]
        table = Table(Column("field", no_wrap=True), *names, "unit", "mark", "meaning")
        for rows in zip(*columns):
            field, _, unit, mark, doc = rows[0]
            table.add_row(field, *(_show(row[1]) for row in rows), unit, mark, doc)
        OUT.print(table)


@dataclass(frozen=True)
class World:
    """Write a mission's world as MJCF, for MuJoCo's own viewer: python -m mujoco.viewer --mjcf=FILE."""

    scenario: str = "medium"
    """small, medium, large or a TOML file"""
    seed: int = 0
    """of the mission"""
    out: Path = Path("world.xml")
    """FILE.xml; its textures go into a folder beside it"""

    def __call__(self):
        _load_mujoco()
        from .models.mjcf import write_world
        from .models.world import make_world

        check_seed(self.seed)
        write_world(make_world(load_scenario(self.scenario), self.seed), self.out)
        _say(f"wrote {self.out}")


@dataclass(frozen=True)
class Figure:
    """Draw the overview of a mission's world with its legend (the paper's benchmark figure)."""

    out: Path
    """FILE.png"""
    scenario: str = "medium"
    """small, medium, large or a TOML file"""
    seed: int = 0
    """of the mission"""

    def __call__(self):
        _load_mujoco()
        from .models.world import make_world
        from .render import overview_figure

        check_seed(self.seed)
        overview_figure(make_world(load_scenario(self.scenario), self.seed), self.out)
        _say(f"wrote {self.out}")


@dataclass(frozen=True)
class Bench:
    """Print this machine's speeds, as rates per CPU-second."""

    scenario: Literal["all", "small", "medium", "large"] = "all"
    """which scenarios"""
    start: bool = False
    """also time a first start (compiles everything once more) and a later one"""

    def __call__(self):
        from .study.bench import all_speeds

        table = Table("what", "rate", "unit")
        names = list(SCENARIOS) if self.scenario == "all" else [self.scenario]
        with LOG.status("measuring"):
            for speed in all_speeds(names, self.start):
                table.add_row(speed.what, f"{speed.rate:,.1f}", speed.unit)
        OUT.print(table)


@dataclass(frozen=True)
class Calibrate:
    """Measure the references on every scale and hold the defaults against the calibration rules."""

    missions: int = 200
    """a figure"""
    workers: int = 2
    """processes"""

    def __call__(self):
        from .study.calibration import FLIGHTS, calibrate, calibration_tables

        _at_least("missions", self.missions, 2)
        _at_least("workers", self.workers, 1)
        with _progress("flying", len(FLIGHTS) * self.missions * len(SCENARIOS)) as advance:
            results = [calibrate(name, self.missions, self.workers, advance) for name in SCENARIOS]
        OUT.print(*calibration_tables(results, self.missions))


Command = Run | Render | Scenarios | World | Figure | Bench | Calibrate


@contextlib.contextmanager
def _progress(what, total):
    """A progress bar on standard error; yields how to advance it."""
    columns = TextColumn(what), BarColumn(), MofNCompleteColumn() if total > 1 else TextColumn("{task.percentage:.0f} %")
    with Progress(*columns, TimeRemainingColumn(), console=LOG, transient=True, disable=not LOG.is_terminal) as progress:
        task = progress.add_task(what, total=total)
        yield lambda amount: progress.advance(task, amount)


def _say(text, console=OUT, **style):
    """Print one line as it is: paths are neither wrapped nor read as markup."""
    console.print(text, markup=False, highlight=False, soft_wrap=True, **style)


def _show(value) -> str:
    return ", ".join(map(_show, value)) if isinstance(value, tuple) else f"{value:g}" if isinstance(value, float) else str(value)


def _parse_size(text) -> tuple[int, int]:
    width, x, height = text.partition("x")
    if not (x and width.isdecimal() and height.isdecimal()):
        raise ValueError(f"--size must be WIDTHxHEIGHT, for example 1280x720, is {text!r}")
    return int(width), int(height)


def _at_least(name, value, least):
    if value < least:
        raise ValueError(f"--{name} must be at least {least}, is {value}")


def _load_mujoco():
    """MuJoCo loads the backend that MUJOCO_GL names when it is imported, and fails however that one fails."""
    try:
        import mujoco  # noqa: F401
    except Exception as error:
        needs = "libegl1 libgl1-mesa-dri libopengl0 (MUJOCO_GL=egl) or libosmesa6 (MUJOCO_GL=osmesa)"
        backend = os.environ.get("MUJOCO_GL")
        raise RuntimeError(f"MUJOCO_GL={backend} does not work here ({error}): install {needs}, or unset it") from None


def _make_folder(path):
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"--out {path}: {error.strerror}") from None
    if not os.access(path, os.W_OK):
        raise ValueError(f"--out {path}: permission denied")


def main(arguments=None) -> int:
    """Run one command; the exit code is 2 for bad input."""
    command = tyro.cli(Command, prog="commhg-mj", description=__doc__.splitlines()[0], args=arguments)
    try:
        command()
        sys.stdout.flush()
    except BrokenPipeError:  # the reader of our output, such as head, has gone
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (ValueError, RuntimeError, OSError, MemoryError) as error:
        _say(f"commhg-mj: {str(error) or 'not enough memory'}", LOG, style="red")
        return 2
    except KeyboardInterrupt:
        _say("interrupted", LOG)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
