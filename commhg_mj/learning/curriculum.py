"""Curriculum: the same weights learn with ever larger teams, before they come to the scenario itself."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path

from ..base.arguments import path_of
from ..base.files import whole_file
from ..scenarios import SCENARIOS, Scenario
from .distributed import ALONE, ProcessGroup
from .ppo import Hyper
from .train import STATE, WEIGHTS, Plan, Training, plan_from_json, plan_to_json

SMALL_TO_LARGE = "small-to-large"
MISSIONS = {"small": 5000, "medium": 1300}  # of the stages before
PLAN = "plan.json"


def smaller(scenario: Scenario) -> list[str]:
    """Scenarios to learn on before this one."""
    return [name for name in MISSIONS if SCENARIOS[name].n_robots < scenario.n_robots]


def stages(plan: Plan, folder) -> list[tuple[Plan, Path]]:
    """(plan, folder) of each stage of a run, the run itself last; one alone unless `plan.init` is SMALL_TO_LARGE."""
    folder = Path(folder)
    if plan.init != SMALL_TO_LARGE:
        return [(plan, folder)]
    found, init = [], ""
    for name in smaller(plan.scenario):
        hyper = Hyper.of(SCENARIOS[name].n_robots, bool(init), lam=plan.hyper.lam, trace=plan.hyper.trace)
        stage = dataclasses.replace(plan, scenario=SCENARIOS[name], missions=MISSIONS[name], init=init, hyper=hyper)
        found.append((stage, folder / name))
        init = str(folder / name / WEIGHTS)
    return [*found, (dataclasses.replace(plan, init=init), folder)]


def trainings(plan: Plan, folder, group: ProcessGroup = ALONE, device: str = "cpu") -> Iterator[Training]:
    """Each stage's training, where it stands; the next one follows once its caller has brought it to its end."""
    for stage, at in stages(plan, folder):
        # All have looked before the first one writes, and nobody reads the stage before until it is written.
        if group.least((at / STATE).exists()):
            training = Training.resume(at, group, device)
            if at == Path(folder):  # a run may have been lengthened; stages before it have lengths of their own
                training.plan = dataclasses.replace(training.plan, missions=plan.missions)
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
