"""Gymnasium's spaces of tables, masks and actions."""

import numpy as np
from gymnasium import spaces

from ..scenarios import Scenario
from .choices import Choices
from .columns import ROWS, table_bounds, table_shape


def table_space(table: str, scenario: Scenario, drop: int = 0) -> spaces.Box:
    """A table's Box, without its first `drop` axes."""
    shape = table_shape(table, scenario)[drop:]
    low, high = (np.broadcast_to(end, shape) for end in table_bounds(table, scenario))
    return spaces.Box(low, high, dtype=np.float32)


def seconds_space(scenario: Scenario) -> spaces.Box:
    """Of a time since the mission's start, or since the last step."""
    return spaces.Box(0.0, scenario.time_limit, (1,), np.float32)


def team_space(scenario: Scenario, choices: Choices) -> spaces.Dict:
    """What a whole team sees."""
    tables: dict[str, spaces.Space] = {table: table_space(table, scenario) for table in ROWS}
    due = spaces.MultiBinary(scenario.n_robots + scenario.n_operators)
    time, mask = seconds_space(scenario), spaces.MultiBinary(choices.n_numbers)
    return spaces.Dict(tables | {"due": due, "time": time, "elapsed": time, "action_mask": mask})
