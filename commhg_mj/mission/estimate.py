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
