"""Commands that measure this machine and the mission's defaults."""

from dataclasses import dataclass
from itertools import chain
from typing import Literal

from rich.table import Table

from ..scenarios import SCENARIOS
from .console import LOG, OUT, at_least, progress, without_effect


@dataclass(frozen=True)
class Bench:
    """Print this machine's speeds, as rates per CPU-second."""

    scenario: Literal["all", "small", "medium", "large"] = "all"
    """which scenarios"""
    start: bool = False
    """also time a first start (compiles everything once more) and a later one"""
    train: bool = False
    """time training alone: simulate, infer and learn"""

    def __call__(self):
        from ..bench.interfaces import interface_rates
        from ..bench.speeds import all_speeds, training_speeds

        if self.train:
            without_effect(self, "train", start="start")
        table = Table("what", "rate", "unit")
        names = list(SCENARIOS) if self.scenario == "all" else [self.scenario]
        with LOG.status("measuring"):
            if self.train:
                speeds = chain.from_iterable(training_speeds(SCENARIOS[name]) for name in names)
            else:
                interfaces = (speed for name in names for speed in interface_rates(SCENARIOS[name]))
                speeds = chain(all_speeds(names, self.start), interfaces)
            for speed in speeds:
                table.add_row(speed.what, f"{speed.rate:,.2f}" if speed.rate < 100 else f"{speed.rate:,.0f}", speed.unit)
        OUT.print(table)


@dataclass(frozen=True)
class Calibrate:
    """Measure the references on every scale and hold the defaults against the calibration rules."""

    missions: int = 200
    """a figure"""
    workers: int = 2
    """processes"""

    def __call__(self):
        from ..study.calibration import FLIGHTS, LINKS, calibrate
        from .tables.calibrate import calibration_tables

        at_least("missions", self.missions, 2)
        at_least("workers", self.workers, 1)
        with progress("flying", len(LINKS) * len(FLIGHTS) * self.missions * len(SCENARIOS)) as advance:
            results = [[calibrate(name, self.missions, self.workers, links, advance) for name in SCENARIOS] for links in LINKS]
        for under_one_model in results:
            OUT.print(*calibration_tables(under_one_model, self.missions))
