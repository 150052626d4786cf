"""What a comparison flies: one mission after another under every condition, on common random numbers."""

import dataclasses
from dataclasses import dataclass

from ...scenarios import Scenario

LINK_MISSIONS = 20  # missions whose every link is looked at
SWEEP_SHARE = 4  # a sweep flies every so many missions' worth, and no fewer than SWEEP_LEAST
SWEEP_LEAST = 10
SWEEPS = {  # quantity: (table, field, values); the scenario's own value is flown anyway
    "foliage rate (dB/m)": ("radio", "foliage_rate", (0.1, 0.2, 0.8)),
    "mountains' height (m)": ("world", "mountain_height", ((20.0, 20.0), (60.0, 60.0), (300.0, 300.0))),
    "UAVs' flight height (m)": ("world", "uav_height", (15.0, 30.0, 120.0)),
}
MODELS = ("abstract", "abstract-fit", "raycast")
SHUFFLED = "raycast-shuffled"
FREE = "obstacle-free "  # begins the labels of the control without obstacles


@dataclass(frozen=True)
class Condition:
    """Missions of one scenario, policy and link model; `label` is unique within a comparison."""

    label: str
    scenario: Scenario
    policy: str
    links: str
    missions: int
    sweep: str = ""  # the quantity that a sweep changes, and its value
    value: float = 0.0


def plan(scenario: Scenario, policies, missions: int) -> list[Condition]:
    """All conditions; the first policy's three models come first, every other policy's follow."""
    policy, *others = policies
    conditions = [Condition(links, scenario, policy, links, missions) for links in (*MODELS, SHUFFLED)]
    free = change(scenario, "world", forest_share=0.0, mountain_share=0.0, heightmap="")
    conditions += [Condition(FREE + links, free, policy, links, missions) for links in ("abstract", "raycast")]
    conditions += [Condition(f"{other} {links}", scenario, other, links, missions) for other in others for links in MODELS]
    fewer = min(missions, max(SWEEP_LEAST, missions // SWEEP_SHARE))
    for quantity, (table, field, values) in SWEEPS.items():
        for value in values:
            number = value[0] if isinstance(value, tuple) else value
            variant = change(scenario, table, **{field: value})
            conditions.append(Condition(f"{quantity} {number:g}", variant, policy, "raycast", fewer, quantity, number))
    return conditions


def own_value(scenario: Scenario, quantity: str) -> float:
    """The scenario's own value of what a sweep changes; of a range its middle."""
    table, field, _ = SWEEPS[quantity]
    value = getattr(getattr(scenario, table), field)
    return sum(value) / 2 if isinstance(value, tuple) else value


def change(scenario: Scenario, table: str, **fields) -> Scenario:
    """The scenario with other values in one of its tables."""
    return dataclasses.replace(scenario, **{table: dataclasses.replace(getattr(scenario, table), **fields)})
