"""What a task is worth to a robot, as far as rules and public attributes tell (initializer, references)."""

from ..base.kernels import kernel
from .service import autonomous_seconds, autonomous_success, controlled_success, slowdown, timeliness

WAITS = 0.9  # how sure a task that is left now is done after the backlog
LEAST_SUCCESS = 0.05  # keeps the expected number of attempts finite


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
def expected_seconds(travel, service, success):
    """Seconds until a task is done, repeated attempts counted."""
    return travel + service / max(LEAST_SUCCESS, success)


@kernel
def expected_wait(rules, n_tasks, n_robots):
    """Seconds until a team would come round to a task that it leaves now: open mean tasks over robots."""
    return (rules.service_base + 0.5 * rules.service_per_difficulty) * n_tasks / n_robots


@kernel
def regret(rules, task, seconds, now, backlog):
    """Value per second that is saved by going now, which takes so many seconds, rather than after the backlog.

    What has decayed already or can wait is worth little.
    """
    later = now + seconds + backlog
    then = timeliness(task.deadline, task.decay, later) if later <= rules.time_limit else 0.0
    return task.value * (timeliness(task.deadline, task.decay, now + seconds) - WAITS * then) / seconds


@kernel
def session_seconds(rules, proficiency, fatigue, embodiment, distance, progress, difficulty):
    """Seconds of control, handover first, until a robot's current attempt ends."""
    service = autonomous_seconds(rules, difficulty) * (1.0 - progress) * slowdown(rules, proficiency, fatigue)
    return 1.0 + rules.handover + distance / rules.speed[1, embodiment] + service


@kernel
def control_gain(rules, proficiency, fatigue, embodiment, distance, progress, difficulty, value, deadline, decay, now):
    """What control would add, per second, to the rest of a robot's current attempt; negative if it harms."""
    alone = 1.0 + distance / rules.speed[0, embodiment] + autonomous_seconds(rules, difficulty) * (1.0 - progress)
    controlled = session_seconds(rules, proficiency, fatigue, embodiment, distance, progress, difficulty)
    worth_alone = autonomous_success(rules, difficulty) * timeliness(deadline, decay, now + alone) / alone
    worth_controlled = (
        controlled_success(rules, difficulty, fatigue) * timeliness(deadline, decay, now + controlled) / controlled
    )
    return value * (worth_controlled - worth_alone)
