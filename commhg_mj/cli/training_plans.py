"""The plan of `commhg-mj train`: a new run's is made of its options, a resumed one's lies in its folder."""

import dataclasses

from ..learning.curriculum import PLAN, SMALL_TO_LARGE, read_plan, smaller, write_plan
from ..learning.ppo import Hyper
from ..learning.registry import make_method
from ..learning.train import STATE, Plan, begin_with, check_learner
from ..radio import find_link_model
from ..scenarios import Scenario, load_scenario
from .console import at_least

OF_HYPER = ("lam", "trace")
OF_PLAN = ("method", "seed", "links", "limitation", "missions", "side_by_side", "workers", "init", "teacher", "plans")


def new_plan(options) -> Plan:
    """What `train` is asked for, all of it known to be right; nothing is written."""
    method, scenario = make_method(options.method, options.plans), load_scenario(options.scenario)
    learner = check_learner(options.learner.split(","))
    find_link_model(options.links)
    for name in ("missions", "workers"):
        at_least(name, getattr(options, name), 1)
    at_least("side-by-side", options.side_by_side, options.workers)
    if not 0 <= options.lam <= 1:
        raise ValueError(f"--lam must be from 0 to 1, is {options.lam}")
    init = _init(options, scenario)
    if init not in ("", SMALL_TO_LARGE):
        begin_with(method, init)
    return Plan(
        options.method, scenario, options.seed, options.links, options.limitation, options.missions,
        options.side_by_side, options.workers, learner, options.teacher, options.plans, init=init,
        hyper=Hyper.of(scenario.n_robots, bool(init), lam=options.lam, trace=options.trace),
    )  # fmt: skip


def _init(options, scenario: Scenario) -> str:
    """Nothing is smaller than the smallest scenario."""
    return "" if options.init == SMALL_TO_LARGE and not smaller(scenario) else options.init


def begin(plan: Plan, folder) -> Plan:
    """Write a new run's plan into its folder, which this process holds."""
    if (folder / PLAN).exists() or (folder / STATE).exists():
        raise ValueError(f"--out {folder} holds a run already: --resume continues it")
    write_plan(plan, folder)
    return plan


def options_of(plan: Plan) -> dict:
    """The options that a run was begun with; its scenario by its name."""
    own = {name: getattr(plan, name) for name in OF_PLAN} | {name: getattr(plan.hyper, name) for name in OF_HYPER}
    return own | {"scenario": plan.scenario.name, "learner": ",".join(plan.learner)}


def lengthened(options) -> Plan:
    """The plan of the run that goes on, with as many missions as are asked for now; nothing else can change."""
    plan, folder = read_plan(options.out), options.out
    own = options_of(plan)
    asked = {name: getattr(options, name) for name in own} | {"init": _init(options, plan.scenario)}
    if asked["scenario"] != own["scenario"] and load_scenario(options.scenario) == plan.scenario:
        asked["scenario"] = own["scenario"]
    fixed = [name for name in own if name != "missions" and asked[name] != own[name]]
    if fixed:
        said = ", ".join(f"--{name.replace('_', '-')} {asked[name]} (it has {own[name]!r})" for name in fixed)
        raise ValueError(f"--resume: the run in {folder} cannot change: {said}")
    if options.missions < plan.missions:
        raise ValueError(f"--missions {options.missions}: the run in {folder} has {plan.missions} and can only become longer")
    if options.missions > plan.missions:
        plan = dataclasses.replace(plan, missions=options.missions)
        write_plan(plan, folder)
    return plan
