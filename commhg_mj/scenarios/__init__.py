"""Scenarios: every number of a mission, with its unit, its mark and its reason.

`fields.py` defines them, `presets.py` holds the paper's three, `reading.py` makes others of TOML files, tables and JSON,
`heightmap.py` of pictures.
"""

from .fields import (
    LIMITATIONS,
    PROFILES,
    CommunicationRules,
    DecisionRules,
    OperatorRules,
    RadioRules,
    RewardRules,
    RobotRules,
    Scenario,
    TaskRules,
    WorldRules,
)
from .presets import SCENARIOS
from .reading import describe, from_dict, from_json, load_scenario, to_json, with_heightmap, with_profile

__all__ = [
    "LIMITATIONS", "PROFILES", "SCENARIOS", "CommunicationRules", "DecisionRules", "OperatorRules", "RadioRules",
    "RewardRules", "RobotRules", "Scenario", "TaskRules", "WorldRules", "describe", "from_dict", "from_json", "load_scenario",
    "to_json", "with_heightmap", "with_profile",
]  # fmt: skip
