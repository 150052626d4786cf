"""What a task is worth to a robot, as far as rules and public attributes tell (initializer, references)."""

from ..kernels import kernel
from .service import timeliness


@kernel
def expected_utility(rules, distance, speed, difficulty, value, deadline, decay, now):
    """Expected discounted value per second of an autonomous robot's next attempt at a task.

    Travel and service take their time; an attempt that fails yields nothing.
    """
    seconds = distance / speed + rules.service_base + rules.service_per_difficulty * difficulty
    success = rules.success_autonomous[0] - rules.success_autonomous[1] * difficulty
    return success * value * timeliness(deadline, decay, now + seconds) / seconds


@kernel
def control_gain(
    rules, proficiency, fatigue, embodiment, distance, progress, difficulty, value, deadline, decay, now
):
    """What control would add, per second, to the rest of a robot's current attempt; negative if it harms."""
    base = (rules.service_base + rules.service_per_difficulty * difficulty) * (1.0 - progress)
    alone = 1.0 + distance / rules.speed[0, embodiment] + base
    slowdown = proficiency * (1.0 + rules.fatigue_slowdown * fatigue)
    controlled = 1.0 + rules.handover + distance / rules.speed[1, embodiment] + base * slowdown
    a, c = rules.success_autonomous, rules.success_controlled
    success_alone = a[0] - a[1] * difficulty
    success_controlled = c[0] - c[1] * difficulty - c[2] * fatigue
    worth_alone = success_alone * timeliness(deadline, decay, now + alone) / alone
    worth_controlled = success_controlled * timeliness(deadline, decay, now + controlled) / controlled
    return value * (worth_controlled - worth_alone)
