"""Commands that train policies and score them on held-out missions."""

import dataclasses
import shlex
from dataclasses import dataclass
from pathlib import Path

from ..mission.batch import check_seed
from ..radio import find_link_model
from ..scenarios import load_scenario
from .console import LOG, OUT, Limitation, at_least, make_folder, progress, say


@dataclass(frozen=True)
class Train:
    """Train a method; Ctrl-C leaves a run that --resume continues to the same bits."""

    out: Path
    """folder of the run: state, weights and log"""
    method: str = "commhg"
    """a learned method"""
    scenario: str = "medium"
    """small, medium, large, or a TOML file that overrides one of them"""
    seed: int = 0
    """of networks, choices and training missions"""
    missions: int = 4000
    """to fly in all; the learning rate falls towards the last"""
    minutes: float | None = None
    """stop after so many minutes of CPU, wherever the run stands"""
    side_by_side: int = 32
    """missions under way at once"""
    init: str = ""
    """weights to begin with, in place of imitating Greedy"""
    links: str = "abstract"
    """link model"""
    limitation: Limitation = "nominal"
    """of communication"""
    resume: bool = False
    """go on with the run in --out; its own options count"""
    tensorboard: bool = False
    """insist on TensorBoard's scalars, which go into --out whenever that package is installed"""

    def __call__(self):
        from ..learning.log import find_writer
        from ..learning.train import Training

        if self.minutes is not None and not self.minutes > 0:
            raise ValueError(f"--minutes must be more than 0, is {self.minutes}")
        if self.tensorboard and find_writer() is None:
            raise ValueError("--tensorboard: the package is not installed: pip install 'commhg_mj[tensorboard]'")
        training = Training.resume(self.out) if self.resume else self._begin()
        try:
            self._run(training)
        except KeyboardInterrupt:
            again = f"commhg-mj train --resume --out {shlex.quote(str(self.out))}"
            raise KeyboardInterrupt(f"interrupted; to go on from the last whole update: {again}") from None

    def _begin(self):
        """A new run, saved once, so that there is something to resume from its first moment on."""
        from ..learning.ppo import Hyper
        from ..learning.registry import find_method
        from ..learning.train import STATE, Plan, Training

        if (self.out / STATE).exists():
            raise ValueError(f"--out {self.out} holds a run already: --resume continues it")
        find_method(self.method)
        find_link_model(self.links)
        check_seed(self.seed)
        for name in ("missions", "side_by_side"):
            at_least(name.replace("_", "-"), getattr(self, name), 1)
        plan = Plan(
            self.method, load_scenario(self.scenario), self.seed, self.links, self.limitation, self.missions,
            self.side_by_side, init=self.init, hyper=Hyper(),
        )  # fmt: skip
        training = Training(plan, self.out)
        make_folder(self.out)
        training.save()
        return training

    def _run(self, training):
        from ..learning.train import WEIGHTS

        limit = float("inf") if self.minutes is None else 60.0 * self.minutes
        while not training.is_done and training.cpu_seconds < limit:
            row = training.update()
            training.log(row)
            training.save()
            say(
                f"update {row['update']:4d}  missions {row['missions']:5d}/{training.plan.missions}  TWCR {row['twcr']:.3f}  "
                f"KL {row['kl']:.4f}  entropy {row['entropy']:.3f}  {row['rate']:5.0f} decisions/CPU-s", LOG,
            )  # fmt: skip
        say(f"{training.folder / WEIGHTS} after {training.cpu_seconds / 60:.0f} CPU-minutes")


@dataclass(frozen=True)
class Evaluate:
    """Score policies on held-out missions, the same for all: TWCR, paired differences to the first, communication."""

    policy: tuple[str, ...] = ("greedy", "random")
    """references, trained methods, or files of weights"""
    scenario: str = "medium"
    """small, medium, large, or a TOML file that overrides one of them"""
    missions: int = 200
    """how many"""
    links: str = "abstract"
    """link model"""
    limitation: Limitation = "nominal"
    """of communication"""
    workers: int = 2
    """processes"""
    out: Path | None = None
    """FILE.json that gets every mission's TWCR and figures of communication"""

    def __call__(self):
        from ..study.evaluate import evaluate, evaluation_tables, save_evaluation

        scenario = load_scenario(self.scenario)
        find_link_model(self.links)
        at_least("missions", self.missions, 2)
        at_least("workers", self.workers, 1)
        with progress("flying", self.missions * len(self.policy)) as advance:
            flights = evaluate(scenario, self.policy, self.missions, self.links, self.limitation, self.workers, advance)
        title = f"{scenario.name}, {self.links} links, {self.limitation} limitation, {self.missions} held-out missions"
        OUT.print(evaluation_tables(title, flights))
        if self.out is not None:
            settings = {name: value for name, value in dataclasses.asdict(self).items() if name not in ("out", "workers")}
            save_evaluation(self.out, settings, flights)
