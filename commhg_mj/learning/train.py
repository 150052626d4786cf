"""Training: collect, update, remember; a run is a folder, and goes on to the same bits after any interruption."""

import dataclasses
import io
import json
import time
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch

from ..base.arguments import LARGEST_SEED, flag, instance, missions_of, names, one_of, path_of, whole
from ..base.files import whole_file
from ..radio import DEFAULT_LINKS
from ..scenarios import Scenario, from_json, to_json
from .critic import ReturnScale
from .distributed import ALONE, ProcessGroup, WorkerEnded
from .first_targets import flown_in
from .ppo import Aim, Hyper, Learner, check_device
from .registry import make_method
from .rollout import Collector, change_rate
from .run_log import Log
from .validation import Validation
from .weights import load_weights, save_weights

FORMAT = "commhg_mj training 8"
STATE, WEIGHTS, CLONED = "state.pt", "weights.safetensors", "cloned.safetensors"
LEARNERS = ("clone", "ppo", "rollouts")  # imitation of the teacher; ppo.py; improvement.py
TEACHERS = ("greedy", "planner")
TRAINING_SEEDS = 10**6  # missions of training seed s begin at (1 + s) times this; evaluation stays far below
VALIDATE_EVERY = 20  # updates
RECENT = 100  # missions whose mean TWCR is shown


@dataclass(frozen=True)
class Plan:
    """Everything that decides a run's bits."""

    method: str
    scenario: Scenario
    seed: int = 0
    links: str = DEFAULT_LINKS
    limitation: str = "nominal"
    missions: int = 3000  # to fly in all
    side_by_side: int = 32
    workers: int = 1  # processes, which share missions and decisions
    learner: tuple[str, ...] = ("clone", "ppo")  # of LEARNERS, one after the other
    teacher: str = "greedy"  # whom `clone` imitates
    plans: bool = False  # robots and operators read the planner's numbers
    first_updates: int = 6  # of ppo's that imitate; given weights are kept in them, while the critic gets to know the missions
    init: str = ""  # weights to begin with
    hyper: Hyper = Hyper()

    def __post_init__(self):
        instance("scenario", self.scenario, Scenario)
        instance("hyper", self.hyper, Hyper)
        for name in ("method", "links", "limitation", "init"):
            instance(name, getattr(self, name), str)
        one_of("teacher", self.teacher, TEACHERS)
        object.__setattr__(self, "learner", check_learner(self.learner))
        flag("plans", self.plans)
        side_by_side = missions_of("side_by_side", self.side_by_side)
        checked = {
            "seed": check_training_seed(self.seed), "missions": whole("missions", self.missions, 1), "side_by_side": side_by_side,
            "workers": whole("workers", self.workers, 1, side_by_side),
            "first_updates": whole("first_updates", self.first_updates, 0),
        }  # fmt: skip
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @property
    def clones(self) -> bool:
        """Whether the teacher is imitated: where more follows, given weights are kept instead."""
        return self.learner[0] == "clone" and (not self.init or len(self.learner) == 1)


class Before(NamedTuple):
    """What became of weights before a run began with them."""

    cpu_seconds: float = 0.0
    learners: tuple[str, ...] = ()


class Run:
    """What a run of any learner says of itself; it has a plan, a folder, what was `before` it, counts, and `written`, its log
    once it is begun.
    """

    def facts(self) -> dict:
        """What a model card says of the training."""
        counts = {"missions": self.missions, "decisions": self.decisions, "updates": self.updates}
        spent = {"cpu_seconds": round(self.cpu_seconds), "cpu_seconds_before": round(self.before.cpu_seconds)}
        own = self.plan.learner if self.plan.clones else [name for name in self.plan.learner if name != "clone"]
        return {"plan": json.loads(plan_to_json(self.plan)), "learners": [*self.before.learners, *own], **spent, **counts}

    def log(self, row: dict) -> None:
        """Append an update's row to the run's log; before `save`, as a resumed run writes it again."""
        self.written = self.written or Log(self.folder, row)
        self.written.write(row)


class Training(Run):
    """One run of a plan that clones or learns by PPO.

    >>> training = Training(plan, "runs/x")
    >>> for row in training.run():
    ...     print(row["twcr"])

    Args:
      state: where the run stood, for `resume`; None: at its beginning.
      group: of `plan.workers` processes, each with a Training of its own.
      device: where the networks learn; missions are flown on the CPU.
    """

    def __init__(self, plan: Plan, folder, state: dict | None = None, group: ProcessGroup = ALONE, device: str = "cpu"):
        torch.set_num_threads(1)
        self.plan, self.folder, self.group = instance("plan", plan, Plan), path_of("folder", folder), group
        self.rng = np.random.default_rng([plan.seed, group.rank])
        torch.manual_seed(plan.seed)
        self.method = make_method(plan.method, plan.plans)
        self.before = Before()
        if state is not None:
            self.method.load_state_dict(state["method"])
        elif plan.init:
            self.before = begin_with(self.method, plan.init)
        self.learner = Learner(self.method, plan.hyper, group, device)
        first = (1 + plan.seed) * TRAINING_SEEDS + group.rank * (TRAINING_SEEDS // group.size)
        self.collector = Collector(
            self.method, flown_in(self.method, plan.scenario), first, group.share(plan.side_by_side), plan.links,
            plan.limitation, self.rng, plan.teacher,
        )  # fmt: skip
        self.updates, self.missions, self.decisions, self.cpu_seconds = 0, 0, 0, 0.0  # of the whole group
        self.validation, self.written = Validation(plan.scenario, plan.links, plan.limitation), None
        if state is not None:
            self._go_on_from(state)

    def _go_on_from(self, state):
        self.learner.optimizer.load_state_dict(state["optimizer"])
        mine = state["workers"][self.group.rank]
        self.collector.load_state_dict(mine["collector"])
        self.rng.bit_generator.state = mine["rng"]
        self.updates, self.missions, self.decisions, self.cpu_seconds = state["counts"]
        self.before = Before(state["before"][0], tuple(state["before"][1:]))

    @property
    def is_done(self) -> bool:
        return self.missions >= self.plan.missions

    @property
    def aim(self) -> Aim:
        if self.plan.learner == ("clone",):
            return "clone"
        if self.updates >= self.plan.first_updates:
            return "improve"
        if self.plan.init:
            return "value"
        return "clone" if self.plan.clones else "improve"

    @property
    def has_cloned(self) -> bool:
        """The last update was the last that imitates the teacher."""
        is_last = self.updates == self.plan.first_updates > 0
        return is_last and self.plan.clones and len(self.plan.learner) > 1

    def run(self, cpu_seconds: float = float("inf")) -> Iterator[dict]:
        """What happened in each update until the run is done, or has cost so much; all that is told is saved."""
        while not self.is_done and self.cpu_seconds + self.before.cpu_seconds < cpu_seconds:
            row = self.update()
            if self.group.is_first:
                self.log(row)
            self.save()
            yield row

    def update(self) -> dict:
        """Collect and learn once; what happened, by name.

        Raises:
          FloatingPointError: a number is none; what was saved before stays as it is.
        """
        start, hyper, collector, aim = time.process_time(), self.plan.hyper, self.collector, self.aim
        self.learner.set_rate(1.0 - self.missions / self.plan.missions, aim)
        data = collector.collect(
            self.group.share(hyper.decisions), self.method.critic, self.method.scale, hyper.gamma, hyper.lam, hyper.trace,
            aim == "clone",
        )  # fmt: skip
        stats = self.learner.update(data, self.rng, aim)
        wrong = ", ".join(f"{name} is {value}" for name, value in stats.items() if not np.isfinite(value))
        if wrong:
            before = f"{self.folder} keeps what was saved before it, to resume or to analyse"
            raise FloatingPointError(f"update {self.updates + 1}: {wrong}: the training has diverged; {before}")
        recent = collector.scores[-self.group.share(RECENT) :]
        missions, twcr, n_recent, decisions, seconds = self.group.total(
            len(collector.scores), sum(recent), len(recent), len(data.robot_state), time.process_time() - start
        )  # fmt: skip
        self.updates, self.missions, self.decisions = self.updates + 1, int(missions), self.decisions + int(decisions)
        self.cpu_seconds += seconds
        facts = {"update": self.updates, "missions": self.missions, "decisions": self.decisions, "cpu_seconds": self.cpu_seconds}
        facts |= {"rate": decisions / seconds, "twcr": twcr / n_recent if n_recent else float("nan")}
        facts["changes"] = change_rate(data)
        is_time = self.group.is_first and (self.updates % VALIDATE_EVERY == 0 or self.has_cloned or self.is_done)
        return facts | {"validation": self.validation.score(self.method) if is_time else float("nan")} | stats

    def save(self) -> None:
        """Write the run's weights, then its state, and nothing half; the state is what counts. The whole group calls it.

        Weights that imitate Greedy stay in a file of their own: what was learned beyond them can be measured.
        """
        workers = self.group.gather({"collector": self.collector.state_dict(), "rng": self.rng.bit_generator.state})
        if not self.group.is_first:
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        for name in [WEIGHTS] + [CLONED] * self.has_cloned:
            save_weights(self.method, self.folder / name, self.facts())
        state = {
            "format": FORMAT, "plan": plan_to_json(self.plan), "method": self.method.state_dict(),
            "optimizer": self.learner.optimizer.state_dict(), "workers": workers,
            "counts": [self.updates, self.missions, self.decisions, self.cpu_seconds],
            "before": [self.before.cpu_seconds, *self.before.learners],
        }  # fmt: skip
        content = io.BytesIO()  # torch's own writer does not say what is wrong with a file
        torch.save(state, content)
        with whole_file(self.folder / STATE) as draft:
            draft.write_bytes(content.getbuffer())

    @classmethod
    def resume(cls, folder, group: ProcessGroup = ALONE, device: str = "cpu") -> "Training":
        """The run in a folder, where it stood.

        Raises:
          ValueError: there is none, or it is damaged or foreign, or another group's; the message names it.
        """
        check_device(device)
        path = path_of("folder", folder) / STATE
        with _naming(path):
            with zipfile.ZipFile(path) as archive:
                if archive.testzip():  # torch does not look at the archive's checksums
                    raise zipfile.BadZipFile
            state = dict(torch.load(path, map_location="cpu", weights_only=True))
            is_ours = state["format"] == FORMAT
            plan = plan_from_json(state["plan"]) if is_ours else None
        if not is_ours:
            raise ValueError(f"{path} is of another format: {state['format']}")
        if plan.workers != group.size:
            raise ValueError(f"{path} is a run of {plan.workers} workers, not {group.size}: see learning/distributed.py")
        with _naming(path):
            return cls(plan, folder, state, group, device)


@contextmanager
def _naming(path):
    try:
        yield
    except FileNotFoundError:
        raise ValueError(f"{path}: there is no run to resume") from None
    except (WorkerEnded, MemoryError, torch.OutOfMemoryError):
        raise
    except Exception as error:  # files are damaged in more ways than torch, JSON and our own rules have errors for
        raise ValueError(f"{path} is damaged or no training ({type(error).__name__})") from error


def check_learner(learner) -> tuple[str, ...]:
    """Learners by name, each at most once and `clone` first.

    Raises:
      ValueError: it is not so.
    """
    found = tuple(names("learner", learner))
    for name in found:
        one_of("learner", name, LEARNERS)
    if "clone" in found[1:]:
        raise ValueError(f"learner: clone comes first, not in {','.join(found)}: what was learned before it would be lost")
    return found


def check_training_seed(seed: int) -> int:
    """The seed as an int; ValueError unless the missions of a training with it have seeds themselves."""
    return whole("seed of a training", seed, 0, LARGEST_SEED // TRAINING_SEEDS - 2)


def begin_with(method, path) -> Before:
    """Give a method the weights of a file; returns what they had cost, and by what they had learned.

    Raises:
      ValueError: the file is refused, or holds another method; the message names it.
    """
    other, facts = load_weights(path)
    if other.name != method.name:
        raise ValueError(f"init: {path} holds {other.name}, not {method.name}")
    if (other.plan is None) != (method.plan is None):
        raise ValueError(f"init: {path} was trained {'without' if other.plan is None else 'with'} --plans")
    method.load_state_dict(other.state_dict())
    method.scale = ReturnScale()  # other missions may pay otherwise
    return Before(facts.get("cpu_seconds", 0) + facts.get("cpu_seconds_before", 0), learners_of(facts))


def learners_of(facts: dict) -> tuple[str, ...]:
    """What weights with such facts learned by, one after the other."""
    return tuple(facts.get("learners", facts.get("plan", {}).get("learner", ())))


def plan_to_json(plan: Plan) -> str:
    """A plan as text."""
    table = {field.name: getattr(plan, field.name) for field in dataclasses.fields(plan)}
    table |= {"scenario": json.loads(to_json(plan.scenario)), "hyper": dataclasses.asdict(plan.hyper)}
    return json.dumps(table)


def plan_from_json(text: str) -> Plan:
    """The plan that `plan_to_json` wrote."""
    table = json.loads(text)
    return Plan(**table | {"scenario": from_json(json.dumps(table["scenario"])), "hyper": Hyper(**table["hyper"])})
