"""What a task is worth to a robot, as far as rules and public attributes tell (initializer, references)."""

from ..base.kernels import kernel
from .service import autonomous_seconds, autonomous_success, controlled_success, slowdown, timeliness


@kernel
def attempt(rules, distance, speed, difficulty, deadline, decay, now):
    """(expected share of the value, seconds) of an autonomous robot's next attempt at a task."""
    seconds = distance / speed + autonomous_seconds(rules, difficulty)
    return autonomous_success(rules, difficulty) * timeliness(deadline, decay, now + seconds), seconds


@kernel
def expected_utility(rules, distance, speed, difficulty, value, deadline, decay, now):
    """Expected discounted value per second of an autonomous robot's next attempt at a task.

    Travel and service take their time; an attempt that fails yields nothing.
    """
    gain, seconds = attempt(rules, distance, speed, difficulty, deadline, decay, now)
    return value * gain / seconds


@kernel
def control_gain(rules, proficiency, fatigue, embodiment, distance, progress, difficulty, value, deadline, decay, now):
    """What control would add, per second, to the rest of a robot's current attempt; negative if it harms."""
    base = autonomous_seconds(rules, difficulty) * (1.0 - progress)
    alone = 1.0 + distance / rules.speed[0, embodiment] + base
    controlled = 1.0 + rules.handover + distance / rules.speed[1, embodiment] + base * slowdown(rules, proficiency, fatigue)
    worth_alone = autonomous_success(rules, difficulty) * timeliness(deadline, decay, now + alone) / alone
    worth_controlled = (
        controlled_success(rules, difficulty, fatigue) * timeliness(deadline, decay, now + controlled) / controlled
    )
    return value * (worth_controlled - worth_alone)
