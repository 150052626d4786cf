"""`commhg_mj.tasks.load`, in the manner of `dm_control.suite.load`."""

from dm_control.rl import control

from ..base.arguments import options_of, said
from . import surveillance

DOMAINS = {"surveillance": surveillance}


def _tasks(tag=None):
    """(domain, task) pairs that carry a tag."""
    suites = {name: domain.SUITE if tag is None else domain.SUITE.tagged(tag) for name, domain in DOMAINS.items()}
    return tuple((name, task) for name, suite in suites.items() for task in suite)


ALL_TASKS = _tasks()
BENCHMARKING, EASY, HARD = _tasks("benchmarking"), _tasks("easy"), _tasks("hard")


def load(domain_name, task_name, task_kwargs=None, environment_kwargs=None, visualize_reward=False) -> control.Environment:
    """A mission as a `dm_control.rl.control.Environment`.

    >>> env = commhg_mj.tasks.load("surveillance", "medium", task_kwargs={"random": 7})

    Args:
      domain_name, task_name: one of `ALL_TASKS`.
      task_kwargs: options of `surveillance.make`: random, links, limitation, period, seeds, pictures, record.
      environment_kwargs: options of `surveillance.MissionEnvironment`: flat_observation, gamma.
      visualize_reward: for dm_control's signature; the mission's colours stay.

    Raises:
      ValueError: there is no such domain or task, or an option is impossible; the message names it.
    """
    if not isinstance(domain_name, str) or domain_name not in DOMAINS:
        raise ValueError(f"unknown domain {said(domain_name)}: use {', '.join(DOMAINS)}")
    suite = DOMAINS[domain_name].SUITE
    if not isinstance(task_name, str) or task_name not in suite:
        raise ValueError(f"unknown task {said(task_name)} of {domain_name}: use {', '.join(suite)}")
    env = suite[task_name](environment_kwargs=environment_kwargs, **options_of("task_kwargs", task_kwargs))
    env.task.visualize_reward = visualize_reward
    return env
