"""Commands that train policies and score them on held-out missions."""

import dataclasses
import shlex
from dataclasses import dataclass
from itertools import product
from math import nan
from pathlib import Path
from typing import Literal

import tyro
from rich.table import Table

from ..base.files import held
from ..base.kernels import ensure_compiled
from ..radio import DEFAULT_LINKS, find_link_model
from ..scenarios import load_scenario
from .console import LOG, OUT, WIDE, Limitation, at_least, check_file, check_folder, make_folder, progress, say


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
    learner: str = "clone,ppo"
    """one or more of clone, ppo and rollouts, with commas between them: each goes on from the one before"""
    teacher: Literal["greedy", "planner"] = "greedy"
    """whom clone imitates"""
    plans: bool = False
    """robots and operators read the planner's numbers, too"""
    missions: int = 4000
    """to fly in all, by each learner; ppo's rate falls towards the last; more of them lengthen a run that is resumed"""
    minutes: float | None = None
    """stop after so many minutes of CPU, wherever the run stands; those of the weights it began with count too"""
    side_by_side: int = 32
    """missions under way at once"""
    workers: int = 1
    """processes, which share these missions and the decisions of an update"""
    device: Literal["cpu", "cuda"] = "cpu"
    """where the networks learn; missions are always flown on the CPU"""
    lam: float = 0.95
    """decay of the advantage's trace"""
    trace: Literal["decision", "second"] = "decision"
    """what the trace decays by: an actor's decisions, or the seconds between them"""
    init: str = ""
    """weights to begin with, in place of imitating the teacher; or small-to-large: learn on every smaller scenario first"""
    links: str = DEFAULT_LINKS
    """link model"""
    limitation: Limitation = "nominal"
    """of communication"""
    resume: bool = False
    """go on with the run in --out, by its own options; --missions lengthens it"""
    tensorboard: bool = False
    """insist on TensorBoard's scalars, which go into --out whenever that package is installed"""

    def __call__(self):
        from ..learning.ppo import check_device
        from ..learning.run_log import find_writer
        from .training_plans import begin, lengthened, new_plan

        if self.minutes is not None and not self.minutes > 0:
            raise ValueError(f"--minutes must be more than 0, is {self.minutes}")
        if self.tensorboard and find_writer() is None:
            raise ValueError("--tensorboard: the package is not installed: pip install 'commhg_mj[tensorboard]'")
        check_device(self.device)
        if self.resume:
            with held(self.out):
                return self._train(lengthened(self))
        plan = new_plan(self)
        make_folder(self.out)
        with held(self.out):
            self._train(begin(plan, self.out))

    def as_begun(self) -> "Train":
        """With the options that the run in --out was begun with."""
        from ..learning.curriculum import read_plan
        from .training_plans import options_of

        return dataclasses.replace(self, **options_of(read_plan(self.out)))

    def _train(self, plan):
        from ..learning.curriculum import follow, trainings
        from ..learning.distributed import process_group

        seconds, updates = float("inf") if self.minutes is None else 60.0 * self.minutes, 0
        if plan.workers > 1:
            ensure_compiled()  # once, not in every process
        try:
            with process_group(plan.workers, follow, plan, self.out, seconds, self.device) as group:
                for training in trainings(plan, self.out, group, self.device):
                    updates += self._run(training, seconds)
        except KeyboardInterrupt as interrupt:
            again = f"commhg-mj train --resume --out {shlex.quote(str(self.out))}"
            again += f" --device {self.device}" if self.device != "cpu" else ""
            what = str(interrupt) or "interrupted"
            raise type(interrupt)(f"{what}; to go on from the last whole update: {again}") from None
        if not updates:
            why = f"all {plan.missions} missions are flown: more --missions" if training.is_done else "more --minutes"
            say(f"nothing was left to do: {why} make the run longer")

    def _run(self, training, seconds):
        """Train, and say how it goes; returns the number of updates."""
        from ..learning.train import WEIGHTS

        plan, shown, before = training.plan, 0, training.updates
        with progress(f"{plan.method} on {plan.scenario.name}", plan.missions) as advance:
            for row in training.run(seconds):
                advance(row["missions"] - shown)
                shown = row["missions"]
                say(_line(row, plan.missions, training.validation), LOG)
        minutes = (training.cpu_seconds + training.before.cpu_seconds) / 60
        say(f"{training.folder / WEIGHTS} after {minutes:.0f} CPU-minutes in all")
        return training.updates - before


def _line(row, missions, validation):
    losses = [name for name in ("task_loss", "pick_loss", "imitation") if row.get(name, nan) == row.get(name, nan)]
    line = f"update {row['update']:4d}  missions {row['missions']:5d}/{missions}  "
    if losses:
        line += "  ".join(f"{name.replace('_', ' ')} {row[name]:.4f}" for name in losses)
    elif "points" in row:
        line += f"TWCR {row['twcr']:.3f}  points {row['points']:6d}  {row['rate']:5.0f} points/CPU-s"
    else:
        line += f"TWCR {row['twcr']:.3f}  KL {row['kl']:.4f}  entropy {row['entropy']:.3f}  {row['rate']:5.0f} decisions/CPU-s"
    if row["validation"] != row["validation"]:  # not every update flies them
        return line
    return f"{line}  validation {row['validation']:.3f}, Greedy {validation.greedy:.3f}"


@dataclass(frozen=True)
class Evaluate:
    """Score policies on held-out missions, the same for all: TWCR, paired differences to the first, communication."""

    policy: tuple[str, ...] = ("greedy", "random")
    """references, trained methods, or files of weights"""
    scenario: tuple[str, ...] = ("medium",)
    """each small, medium, large, or a TOML file that overrides one of them"""
    missions: int = 200
    """how many, on each scenario"""
    links: tuple[str, ...] = (DEFAULT_LINKS,)
    """link models"""
    limitation: tuple[Limitation, ...] = ("nominal",)
    """of communication"""
    workers: int = 2
    """processes"""
    out: Path | None = None
    """FILE.json that gets every mission's TWCR and figures of communication, condition by condition"""

    def __call__(self):
        from ..study.evaluation import Condition, evaluate, save_evaluation
        from .tables.evaluate import evaluation_tables, summary_table

        check_file(self.out)
        for option in ("policy", "scenario", "links", "limitation"):
            if not getattr(self, option):
                raise ValueError(f"--{option}: name at least one")
        scenarios = list(map(load_scenario, self.scenario))
        for links in self.links:
            find_link_model(links)
        at_least("missions", self.missions, 2)
        at_least("workers", self.workers, 1)
        conditions = [Condition(*each) for each in product(scenarios, self.links, self.limitation)]
        results = []
        with progress("flying", self.missions * len(self.policy) * len(conditions)) as advance:
            for condition in conditions:
                scenario, links, limitation = condition
                flights = evaluate(scenario, self.policy, self.missions, links, limitation, self.workers, advance)
                results.append((condition, flights))
                OUT.print(evaluation_tables(f"{condition}, {self.missions} held-out missions", flights))
        if len(results) > 1:
            WIDE.print(summary_table(results, self.missions))
        if self.out is not None:
            save_evaluation(self.out, self.missions, results)


@dataclass(frozen=True)
class Publish:
    """Score a run's weights on held-out missions and write them with a model card, as the package's own were."""

    run: tyro.conf.Positional[Path]
    """folder of a run, or a file of weights"""
    out: Path = Path("commhg_mj/learning/trained")
    """folder that gets METHOD-SCENARIO.safetensors and .md"""
    missions: int = 200
    """how many"""
    links: str = DEFAULT_LINKS
    """link model"""
    limitation: Limitation = "nominal"
    """of communication"""
    workers: int = 2
    """processes"""

    def __call__(self):
        from ..base.files import whole_file
        from ..learning.pretrained import ENDING
        from ..learning.train import WEIGHTS
        from ..learning.weights import load_weights, save_weights
        from ..study.model_card import N_FLIGHTS, make_card

        path = self.run / WEIGHTS if self.run.is_dir() else self.run
        find_link_model(self.links)
        at_least("missions", self.missions, 2)
        at_least("workers", self.workers, 1)
        check_folder(self.out)
        with progress("flying", self.missions * N_FLIGHTS) as advance:
            name, card = make_card(path, self.missions, self.links, self.limitation, self.workers, advance)
        make_folder(self.out)
        method, facts = load_weights(path)
        save_weights(method, self.out / f"{name}{ENDING}", facts, with_critic=False)
        with whole_file(self.out / f"{name}.md") as draft:
            draft.write_text(card, encoding="utf-8")
        say(f"{self.out / name}{ENDING} and its card {name}.md")


@dataclass(frozen=True)
class Curves:
    """Hold training runs side by side: their learning curves, and their weights beside those that only imitated Greedy."""

    runs: tyro.conf.Positional[tuple[Path, ...]]
    """folders of runs on one scenario"""
    out: Path = Path("learning-curves.png")
    """figure"""
    missions: int = 200
    """held-out missions for each file of weights"""
    workers: int = 2
    """processes"""

    def __call__(self):
        from ..study.learning_curves import draw_curves, study_runs
        from .tables.curves import curves_table

        if not self.runs:
            raise ValueError("RUNS: name at least one folder of a run")
        check_file(self.out)
        at_least("missions", self.missions, 2)
        at_least("workers", self.workers, 1)
        with progress("flying", self.missions * (1 + 2 * len(self.runs))) as advance:
            study = study_runs(self.runs, self.missions, self.workers, advance)
        draw_curves(study, self.out)
        OUT.print(curves_table(study, self.missions))
        say(str(self.out))


@dataclass(frozen=True)
class Methods:
    """List the learned methods: what each reads, decides and costs, where it comes from, and what of it is ours."""

    def __call__(self):
        from ..learning.method_table import HEAD, method_rows

        table = Table(*HEAD)
        for row in method_rows():
            table.add_row(*row)
        OUT.print(table)
