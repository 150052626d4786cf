"""Scenarios: every number of a mission, with its unit, its mark and its reason.

`fields.py` defines them, `presets.py` holds the paper's three, `reading.py` makes others of TOML files, tables and JSON,
`heightmap.py` of pictures, `parts.py` smaller ones of these.
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
from .parts import part_of
from .presets import SCENARIOS
from .reading import describe, from_dict, from_json, load_scenario, to_json, with_heightmap, with_profile

__all__ = [
    "LIMITATIONS", "PROFILES", "SCENARIOS", "CommunicationRules", "DecisionRules", "OperatorRules", "RadioRules",
    "RewardRules", "RobotRules", "Scenario", "TaskRules", "WorldRules", "describe", "from_dict", "from_json", "load_scenario",
    "part_of", "to_json", "with_heightmap", "with_profile",
]  # fmt: skip
