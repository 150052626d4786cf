"""Scenarios by name: the paper's three scales, and whatever others add."""

from ..base.registries import Registry
from .fields import RadioRules, Scenario, TaskRules, WorldRules

# Fitted decays as `commhg-mj fit --missions 200` printed them at the former prices (docs/calibration.md).
PRESETS = {  # deadlines grow with the way to go
    "small": Scenario(
        "small", 500.0, 22, 600, 2, 2, 2, WorldRules(n_forests=4, n_mountains=2), tasks=TaskRules(deadline=(75.0, 415.0)),
        radio=RadioRules(fitted_forest_decay=689.8, fitted_mountain_decay=324.6),
    ),
    "medium": Scenario("medium", 1000.0, 56, 1200, 4, 4, 3),
    "large": Scenario(
        "large", 2000.0, 112, 2400, 8, 8, 6, WorldRules(n_forests=10, n_mountains=5), tasks=TaskRules(deadline=(140.0, 740.0)),
        radio=RadioRules(fitted_forest_decay=523.0, fitted_mountain_decay=327.7),
    ),
}  # fmt: skip
SCENARIOS = Registry("scenario", "commhg_mj.scenarios", PRESETS)
