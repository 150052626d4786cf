"""Commands about radio links."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from ..base.arguments import check_seed
from ..flights.held_out import HELD_OUT
from ..mission.trace import load_trace
from ..scenarios import SCENARIOS, load_scenario, with_profile
from .console import OUT, Limitation, Profile, at_least, check_png, load_mujoco, progress, say, without_effect


@dataclass(frozen=True)
class Links:
    """Show one link under the abstract and the ray-cast model, side by side."""

    start: Annotated[str, tyro.conf.arg(name="from")]
    """uav0, ugv1, ..., station, or X,Y[,Z] in metres, Z above the ground"""
    end: Annotated[str, tyro.conf.arg(name="to")]
    """likewise"""
    scenario: str = "medium"
    """small, medium, large or a TOML file"""
    seed: int = 0
    """of the mission"""
    at: float = 0.0
    """the second; without --trace of a mission flown by greedy under abstract links"""
    trace: Path | None = None
    """take scenario, seed, limitation and the robots' places from this trace"""
    limitation: Limitation = "nominal"
    """of communication"""
    radio_profile: Profile | None = None
    """calibration of the ray-cast model; by default the scenario's"""
    out: Path | None = None
    """FILE.png: a vertical cross-section of terrain, canopies, ray and first Fresnel zone"""

    def __call__(self):
        load_mujoco()
        from ..base.charts import save_figure
        from ..models.world import make_world
        from ..planning.endpoints import parse_endpoint
        from ..planning.section import positions_at, section_figure, view_link
        from .tables.one_link import link_table

        check_png(self.out)
        trace = load_trace(self.trace) if self.trace else None
        if trace:
            without_effect(self, "trace", scenario="scenario", seed="seed", limitation="limitation")
        scenario = with_profile(trace.scenario if trace else load_scenario(self.scenario), self.radio_profile)
        seed, limitation = (trace.seed, trace.limitation) if trace else (check_seed(self.seed), self.limitation)
        places = [parse_endpoint(self.start, scenario, "from"), parse_endpoint(self.end, scenario, "to")]
        if trace is None:
            robots = positions_at(scenario, seed, self.at)
        elif 0 <= self.at <= trace.ticks:
            robots = trace.robot_xy[round(self.at)]
        else:
            raise ValueError(f"--at {self.at:g} lies outside the mission, 0..{trace.ticks} s")
        link = view_link(make_world(scenario, seed), places, robots, limitation)
        if self.out:
            save_figure(section_figure(link), self.out)
        OUT.print(link_table(link))
        if self.out:
            say(f"wrote {self.out}")


@dataclass(frozen=True)
class Coverage:
    """Draw how likely a message from one place is delivered all over the map, under both models."""

    out: Path
    """FILE.png"""
    source: Annotated[str, tyro.conf.arg(name="from")] = "station"
    """station, or X,Y[,Z] in metres, Z above the ground"""
    height: float = 1.5
    """of the receivers above the ground (m)"""
    scenario: str = "medium"
    """small, medium, large or a TOML file"""
    seed: int = 0
    """of the mission"""
    limitation: Limitation = "nominal"
    """of communication"""
    radio_profile: Profile | None = None
    """calibration of the ray-cast model; by default the scenario's"""

    def __call__(self):
        load_mujoco()
        from ..base.charts import save_figure
        from ..models.world import make_world
        from ..planning.coverage import cover, coverage_figure
        from ..planning.endpoints import parse_endpoint

        check_png(self.out)
        scenario = with_profile(load_scenario(self.scenario), self.radio_profile)
        source = parse_endpoint(self.source, scenario, "from")
        coverage = cover(make_world(scenario, check_seed(self.seed)), source, self.height, self.limitation)
        save_figure(coverage_figure(coverage), self.out)
        for model, delivered in coverage.delivered.items():
            say(f"{model}: mean delivery {delivered.mean():.4f}, at least one half on {(delivered >= 0.5).mean():.1%} of the map")
        say(f"wrote {self.out}")


@dataclass(frozen=True)
class Fit:
    """Fit the abstract model's decay lengths to ray-cast links by maximum likelihood (the abstract-fit preset)."""

    scenario: str = "all"
    """small, medium, large, a TOML file, or all"""
    missions: int = 40
    """flown by greedy under ray-cast links; their robots' places are the links' ends"""
    radio_profile: Profile | None = None
    """calibration of the ray-cast model; by default the scenario's"""
    workers: int = 2
    """processes"""

    def __call__(self):
        load_mujoco()
        from ..planning.decay_fit import fit
        from .tables.one_link import fit_table

        at_least("missions", self.missions, 1)
        at_least("workers", self.workers, 1)
        scenarios = list(SCENARIOS.values()) if self.scenario == "all" else [load_scenario(self.scenario)]
        scenarios = [with_profile(scenario, self.radio_profile) for scenario in scenarios]
        with progress("flying", len(scenarios) * self.missions) as advance:
            results = [fit(scenario, self.missions, self.workers, advance) for scenario in scenarios]
        OUT.print(fit_table(results))


@dataclass(frozen=True)
class Compare:
    """Fly the same missions under every link model; write tables, figures and a self-contained report.html."""

    out: Path
    """folder; an interrupted comparison goes on from what it holds"""
    scenario: str = "medium"
    """small, medium, large or a TOML file"""
    policy: tuple[str, ...] = ("greedy",)
    """one or more registered policies; link and message statistics are those of the first"""
    missions: int = 200
    """a condition"""
    seed: int = HELD_OUT
    """of the first mission; the others count up from it"""
    limitation: Limitation = "nominal"
    """of communication"""
    radio_profile: Profile | None = None
    """calibration of the ray-cast model; by default the scenario's"""
    workers: int = 2
    """processes"""
    clip: bool = True
    """render a short side-by-side video into the report"""

    def __call__(self):
        load_mujoco()
        from ..study.comparison import compare, count_flights

        at_least("missions", self.missions, 2)
        at_least("workers", self.workers, 1)
        check_seed(self.seed)
        check_seed(self.seed + self.missions - 1)
        scenario = with_profile(load_scenario(self.scenario), self.radio_profile)
        with progress("flying", count_flights(scenario, self.policy, self.missions)) as advance:
            report = compare(
                scenario, self.policy, self.missions, self.out, self.seed, self.limitation, self.workers, self.clip, advance
            )
        say(f"wrote {report}")
