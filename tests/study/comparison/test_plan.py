"""What a comparison flies: unique labels, and sweeps that change one quantity."""

import dataclasses

import pytest
from strategies import change

from commhg_mj.scenarios import SCENARIOS, describe
from commhg_mj.study.comparison import count_flights
from commhg_mj.study.comparison.flown_parts import LINK_MISSIONS, _part
from commhg_mj.study.comparison.plan import FREE, MODELS, SHUFFLED, SWEEPS, own_value, plan

POLICIES = ["greedy", "random", "another"]
CHANGED = {  # quantity of a sweep: the field that it may change
    "foliage rate (dB/m)": "radio.foliage_rate",
    "mountains' height (m)": "world.mountain_height",
    "UAVs' flight height (m)": "world.uav_height",
}


def differences(one, other):
    """{field: value in other} of the fields that differ."""
    return {name: value for (name, own, *_), (_, value, *_) in zip(describe(one), describe(other)) if own != value}


@pytest.mark.parametrize("name", SCENARIOS)
def test_labels_and_files_are_unique(name, tmp_path):
    conditions = plan(SCENARIOS[name], POLICIES, 7)
    labels = [condition.label for condition in conditions]
    assert len(set(labels)) == len(labels) == 4 + 2 + 2 * 3 + 9
    files = {_part(tmp_path, label, [5, 6]).name for label in labels}
    assert len(files) == len(labels) and not any(set(file) & set(' /\\:"*?<>|\'()') for file in files)


def test_the_first_policy_flies_everything_and_the_others_every_model():
    conditions = plan(SCENARIOS["medium"], POLICIES, 40)
    main = {(c.label, c.policy, c.links) for c in conditions if c.scenario == SCENARIOS["medium"]}
    expected = {(links, "greedy", links) for links in ("abstract", "abstract-fit", "raycast", "raycast-shuffled")}
    expected |= {(f"{other} {links}", other, links) for other in POLICIES[1:] for links in MODELS}
    assert main == expected
    assert {c.missions for c in conditions if not c.sweep} == {40} and SHUFFLED not in MODELS


def test_the_control_has_no_obstacles_and_nothing_else_differs():
    scenario = SCENARIOS["large"]
    free = [c for c in plan(scenario, ["random"], 4) if c.label.startswith(FREE)]
    assert [(c.policy, c.links) for c in free] == [("random", "abstract"), ("random", "raycast")]
    for condition in free:
        assert differences(scenario, condition.scenario) == {"world.forest_share": 0, "world.mountain_share": 0}


@pytest.mark.parametrize("name", SCENARIOS)
def test_sweeps_leave_the_other_fields_alone(name):
    sweeps = [c for c in plan(SCENARIOS[name], ["greedy", "random"], 100) if c.sweep]
    assert {c.sweep for c in sweeps} == set(CHANGED) == set(SWEEPS)
    for condition in sweeps:
        changed = differences(SCENARIOS[name], condition.scenario)
        assert list(changed) == [CHANGED[condition.sweep]]
        (value,) = changed.values()
        assert value in (condition.value, (condition.value, condition.value)) and condition.label.endswith(f"{condition.value:g}")
        assert (condition.links, condition.policy) == ("raycast", "greedy")
        assert condition.value != own_value(SCENARIOS[name], condition.sweep)


def test_own_values():
    scenario = change(SCENARIOS["small"], foliage_rate=0.5, mountain_height=(40.0, 60.0), uav_height=33.0)
    assert [own_value(scenario, quantity) for quantity in CHANGED] == [0.5, 50.0, 33.0]


@pytest.mark.parametrize("missions, swept", [(2, 2), (10, 10), (11, 10), (40, 10), (44, 11), (200, 50)])
def test_sweeps_fly_fewer_missions(missions, swept):
    assert {c.missions for c in plan(SCENARIOS["small"], ["greedy"], missions) if c.sweep} == {swept}


@pytest.mark.parametrize("policies, missions", [(["greedy"], 3), (["greedy", "random"], 3), (["greedy"], 60)])
def test_flights_are_counted(policies, missions):
    """Four models and two controls of the first policy, three of every other, nine sweeps, and the looks at links."""
    full = (4 + 2 + 3 * (len(policies) - 1)) * missions
    expected = full + 9 * min(missions, max(10, missions // 4)) + min(missions, LINK_MISSIONS)
    assert count_flights(SCENARIOS["small"], policies, missions) == expected


def test_conditions_travel_to_other_processes():
    assert all(dataclasses.replace(c) == c and hash(c) for c in plan(SCENARIOS["small"], ["greedy"], 2))
