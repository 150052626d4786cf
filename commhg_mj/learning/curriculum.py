"""Curriculum: the same weights learn with ever larger teams, before they come to the scenario itself."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path

from ..base.arguments import path_of
from ..base.files import whole_file
from ..scenarios import SCENARIOS, Scenario
from .distributed import ALONE, ProcessGroup
from .improvement import Improvement
from .ppo import Hyper
from .train import STATE, WEIGHTS, Plan, Training, plan_from_json, plan_to_json

SMALL_TO_LARGE = "small-to-large"
MISSIONS = {"small": 5000, "medium": 1300}  # of the stages before
PLAN = "plan.json"


def smaller(scenario: Scenario) -> list[str]:
    """Scenarios to learn on before this one."""
    return [name for name in MISSIONS if SCENARIOS[name].n_robots < scenario.n_robots]


def stages(plan: Plan, folder) -> list[tuple[Plan, Path]]:
    """(plan, folder) of each stage of a run, the run itself last: every smaller scenario first for SMALL_TO_LARGE, and on each
    scenario the learners one after the other, of which cloning and PPO are one stage.
    """
    folder, found = Path(folder), []
    each, init = [(plan.scenario, plan.missions, folder)], plan.init
    if plan.init == SMALL_TO_LARGE:
        each, init = [(SCENARIOS[name], MISSIONS[name], folder / name) for name in smaller(plan.scenario)] + each, ""
    for scenario, missions, at in each:
        hyper = plan.hyper
        if scenario is not plan.scenario:
            hyper = Hyper.of(scenario.n_robots, bool(init), lam=hyper.lam, trace=hyper.trace)
        parts = [part for part in parts_of(plan.learner) if not (init and part == ("clone",))] or [plan.learner]
        for part in parts:
            where = at if part is parts[-1] else at / "-".join(part)
            if part is not parts[0]:  # what was learned is sharp: a pull to entropy would undo it
                hyper = dataclasses.replace(hyper, entropy=0.0)
            stage = dataclasses.replace(plan, scenario=scenario, missions=missions, learner=part, init=init, hyper=hyper)
            found.append((stage, where))
            init = str(where / WEIGHTS)
    return found


def parts_of(learner: tuple[str, ...]) -> list[tuple[str, ...]]:
    """Learners that are one stage each."""
    at = learner.index("rollouts") if "rollouts" in learner else len(learner)
    return [part for part in (learner[:at], learner[at : at + 1], learner[at + 1 :]) if part]


def trainings(plan: Plan, folder, group: ProcessGroup = ALONE, device: str = "cpu") -> Iterator[Training | Improvement]:
    """Each stage's training, where it stands; the next one follows once its caller has brought it to its end."""
    for stage, at in stages(plan, folder):
        if stage.learner == ("rollouts",):
            training = Improvement(stage, at, group)
        # All have looked before the first one writes, and nobody reads the stage before until it is written.
        elif group.least((at / STATE).exists()):
            training = Training.resume(at, group, device)
            training.plan = dataclasses.replace(training.plan, missions=stage.missions)  # it may have been lengthened
        else:
            training = Training(stage, at, group=group, device=device)
            training.save()  # something to resume from, from the first moment on
        yield training
        if not training.is_done:
            return


def follow(group: ProcessGroup, plan: Plan, folder, cpu_seconds: float, device: str) -> None:
    """A worker's part of a run: the same steps as the first process, in silence."""
    for training in trainings(plan, folder, group, device):
        for _ in training.run(cpu_seconds):
            pass


def write_plan(plan: Plan, folder) -> None:
    """The whole configuration of a run as JSON, beside its state."""
    with whole_file(Path(folder) / PLAN) as draft:
        draft.write_text(plan_to_json(plan))


def read_plan(folder) -> Plan:
    """The plan of the run in a folder.

    Raises:
      ValueError: there is none, or it is damaged; the message names it.
    """
    path = path_of("folder", folder) / PLAN
    try:
        return plan_from_json(path.read_text())
    except FileNotFoundError:
        raise ValueError(f"{path}: there is no run to resume") from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path} is damaged, or no plan of this version ({type(error).__name__})") from None
