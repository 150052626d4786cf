"""Commands that measure this machine and the mission's defaults."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, product
from pathlib import Path
from typing import Literal

from rich.table import Table

from ..radio import DEFAULT_LINKS, find_link_model
from ..scenarios import SCENARIOS, load_scenario
from .console import LOG, OUT, WIDE, at_least, check_file, progress, say, without_effect


@dataclass(frozen=True)
class Bench:
    """Print this machine's speeds, as rates per CPU-second."""

    scenario: Literal["all", "small", "medium", "large"] = "all"
    """which scenarios"""
    start: bool = False
    """also time a first start (compiles everything once more) and a later one"""
    train: bool = False
    """time training alone: simulate, infer and learn"""
    peers: bool = False
    """with --train: MAPPO and IPPO beside BenchMARL's, which wants an environment of its own (docs/learning.md)"""

    def __call__(self):
        if self.peers and not self.train:
            raise ValueError("--peers has no effect without --train")
        if self.train:
            without_effect(self, "train", start="start")
        names = list(SCENARIOS) if self.scenario == "all" else [self.scenario]
        speeds = training_speeds(names, self.peers) if self.train else flying_speeds(names, self.start)
        table = Table("what", "rate", "unit")
        with LOG.status("measuring"):
            for speed in speeds:
                table.add_row(speed.what, f"{speed.rate:,.2f}" if speed.rate < 100 else f"{speed.rate:,.0f}", speed.unit)
        OUT.print(table)


def flying_speeds(names, with_start) -> Iterator:
    """What `bench` measures of scenarios."""
    from ..bench.interfaces import interface_rates
    from ..bench.speeds import all_speeds

    return chain(all_speeds(names, with_start), chain.from_iterable(interface_rates(SCENARIOS[name]) for name in names))


def training_speeds(names, beside_peers) -> Iterator:
    """What `bench --train` measures of scenarios."""
    if beside_peers:
        try:
            from ..bench.peers import peer_rates as measure
        except ImportError as error:
            raise ValueError(f"--peers needs BenchMARL, in an environment of its own (docs/learning.md): {error}") from None
    else:
        from ..bench.training_rates import commhg_rates as measure
    return chain.from_iterable(measure(SCENARIOS[name]) for name in names)


@dataclass(frozen=True)
class Calibrate:
    """Measure the references on each scale and hold the defaults against the calibration rules."""

    scenario: tuple[str, ...] = ()
    """by name; without any, every named one"""
    missions: int = 200
    """a figure"""
    workers: int = 2
    """processes"""

    def __call__(self):
        from ..study.calibration import LINKS, N_FLIGHTS, calibrate
        from .tables.calibrate import calibration_tables

        at_least("missions", self.missions, 2)
        at_least("workers", self.workers, 1)
        names = self.scenario or tuple(SCENARIOS)
        for name in names:
            SCENARIOS.find(name)
        with progress("flying", len(LINKS) * N_FLIGHTS * self.missions * len(names)) as advance:
            results = [[calibrate(name, self.missions, self.workers, links, advance) for name in names] for links in LINKS]
        for under_one_model in results:
            WIDE.print(*calibration_tables(under_one_model, self.missions))


@dataclass(frozen=True)
class Value:
    """Print what information is worth to policies: the same held-out missions with less of it, with more, and with all."""

    policy: tuple[str, ...] = ("greedy", "cbba", "planner")
    """references, trained methods, or files of weights; none of them privileged"""
    scenario: tuple[str, ...] = ("medium",)
    """each small, medium, large, or a TOML file that overrides one of them"""
    missions: int = 100
    """how many, for every figure"""
    links: str = DEFAULT_LINKS
    """link model where a figure does not name one"""
    workers: int = 2
    """processes"""
    out: Path | None = None
    """FILE.png that gets TWCR against the share of the byte budget"""

    def __call__(self):
        from ..study.information_value import N_FLIGHTS, check_policies, draw_budgets, measure_value
        from .tables.value import value_tables

        check_file(self.out)
        find_link_model(self.links)
        at_least("missions", self.missions, 2)
        at_least("workers", self.workers, 1)
        if not self.scenario:
            raise ValueError("--scenario: name at least one")
        cases = list(product(map(load_scenario, self.scenario), check_policies(self.policy)))
        with progress("flying", N_FLIGHTS * self.missions * len(cases)) as advance:
            values = [measure_value(*case, self.missions, self.links, self.workers, advance) for case in cases]
        WIDE.print(*value_tables(values, self.links, self.missions))
        if self.out is not None:
            draw_budgets(values, self.out)
            say(f"wrote {self.out}", OUT)
