"""Commands that fly and show missions."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from ..base.arguments import check_seed
from ..flights.fly import fly, trace_path
from ..mission.trace import load_trace
from ..policies import find_policy
from ..radio import DEFAULT_LINKS, find_link_model
from ..scenarios import load_scenario, with_profile
from .console import LOG, OUT, Limitation, Profile, at_least, load_mujoco, make_folder, parse_size, progress, say, without_effect


@dataclass(frozen=True)
class Run:
    """Fly missions and print how they went."""

    scenario: str = "medium"
    """small, medium, large, or a TOML file that overrides one of them"""
    policy: str = "greedy"
    """random, greedy, cbba, planner, omniscient (privileged reference), a trained method or a file of weights"""
    seed: int = 0
    """of the first mission; the others count up from it"""
    missions: int = 1
    """how many"""
    limitation: Limitation = "nominal"
    """of communication"""
    links: str = DEFAULT_LINKS
    """raycast, abstract (the paper's, planar), abstract-fit, raycast-shuffled (a control), perfect, known or silent (bounds)"""
    radio_profile: Profile | None = None
    """calibration of the ray-cast model; by default the scenario's"""
    workers: int = 1
    """processes"""
    out: Path | None = None
    """folder that gets one trace a mission; it replaces none of another scenario or policy"""
    video: bool = False
    """also render the first mission (into --out, by default the folder runs)"""
    json: bool = False
    """print one JSON object on standard output and nothing else"""

    def __call__(self):
        from .tables.scores import summary_json, summary_table

        scenario = with_profile(load_scenario(self.scenario), self.radio_profile)
        privileged = find_policy(self.policy).is_privileged
        find_link_model(self.links)
        at_least("missions", self.missions, 1)
        at_least("workers", self.workers, 1)
        check_seed(self.seed)
        check_seed(self.seed + self.missions - 1)
        folder = self.out or (Path("runs") if self.video else None)
        if folder is not None:
            make_folder(folder)
        seeds = range(self.seed, self.seed + self.missions)
        links = "perfect" if privileged else self.links
        settings = {
            "scenario": scenario.name, "policy": self.policy, "links": links, "limitation": self.limitation,
        }  # fmt: skip
        with progress("flying", self.missions) as advance:
            scores = fly(scenario, self.policy, seeds, self.links, self.limitation, folder, self.workers, advance)
        if self.json:
            print(summary_json({**settings, "privileged": privileged}, seeds, scores))
        else:
            mark = " (PRIVILEGED REFERENCE: true state)" if privileged else ""
            title = f"{scenario.name}, {self.policy}{mark}, {links} links, {self.limitation} limitation, {self.missions} missions"
            OUT.print(summary_table(title, scores))
        if self.video:
            path = trace_path(folder, scenario, self.policy, self.links, self.limitation, self.seed)
            Render((path,), path.with_suffix(".mp4"))(report=LOG)


@dataclass(frozen=True)
class Render:
    """Render a trace to a video, or one moment of it to a picture; or two of the same mission side by side."""

    traces: tyro.conf.Positional[tuple[Path, ...]]
    """one trace file, from `run --out`, or two of the same scenario and seed"""
    out: Path
    """FILE.mp4, or FILE.png with --at"""
    camera: str = "overview"
    """overview, station, map, orbit or follow:ROBOT, for example follow:uav0"""
    size: str | None = None
    """WIDTHxHEIGHT in pixels of a mission's picture; by default 1280x720, and 960x540 for each of two"""
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
    coverage: str | None = None
    """station, or X,Y[,Z]: drape its delivery probability under the trace's link model over the ground"""
    coverage_height: float = 1.5
    """of the receivers above the ground (m)"""
    workers: int = 2
    """processes"""

    def __call__(self, report=OUT):
        load_mujoco()
        from ..render import check_same_mission, render_image, render_video

        if self.at is not None:
            without_effect(self, "at", start="from", stop="to", fps="fps", speed="speed")
        if self.coverage is None and self.coverage_height != Render.coverage_height:
            raise ValueError("--coverage-height has no effect without --coverage")
        traces, size = tuple(map(load_trace, self.traces)), self.size and parse_size(self.size)
        if len(traces) == 2:
            check_same_mission(*traces, self.traces)  # here by their files' names
        drapes = tuple(map(self._drape, traces))
        if self.at is not None:
            render_image(traces, self.out, self.at, self.camera, size, drape=drapes)
        else:
            with progress("rendering", 1) as advance:
                render_video(
                    traces, self.out, self.camera, size, self.fps, self.speed, self.start, self.stop, self.workers,
                    lambda done, total: advance(1 / total), drapes,
                )  # fmt: skip
        say(f"wrote {self.out}", report)

    def _drape(self, trace):
        """What --coverage asks for, under the trace's own link model."""
        if self.coverage is None:
            return None
        from ..models.world import make_world
        from ..planning.coverage import cover
        from ..planning.endpoints import parse_endpoint
        from ..render import coverage_drape

        source = parse_endpoint(self.coverage, trace.scenario, "coverage")
        world, label = make_world(trace.scenario, trace.seed), f"delivery probability from {source.text}"
        options = "coverage", "coverage-height"
        coverage = cover(world, source, self.coverage_height, trace.limitation, (trace.links,), options)
        return coverage_drape(coverage.delivered[trace.links], label)
