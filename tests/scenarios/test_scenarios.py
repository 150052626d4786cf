"""Scenarios: every impossible field is refused by its name, and every field is documented."""

import dataclasses
import json
import math

import pytest
from hypothesis import given, settings
from strategies import scenarios

from commhg_mj.models.world import make_world
from commhg_mj.scenarios import (
    LIMITATIONS,
    SCENARIOS,
    Scenario,
    TaskRules,
    describe,
    from_dict,
    from_json,
    load_scenario,
    to_json,
)

TABLES = [field.name for field in dataclasses.fields(Scenario) if dataclasses.is_dataclass(field.default)]
FIELDS = [(name, value, unit, mark, doc) for name, value, unit, mark, doc in describe(SCENARIOS["medium"])]
NUMBERS = [name for name, value, *_ in FIELDS if not isinstance(value, str)]


def nested(name, value):
    """{"tasks": {"decay": value}} for "tasks.decay"."""
    table, _, field = name.rpartition(".")
    return {table: {field: value}} if table else {field: value}


def field_of(name):
    table, _, field = name.rpartition(".")
    rules = getattr(SCENARIOS["medium"], table) if table else SCENARIOS["medium"]
    return next(f for f in dataclasses.fields(rules) if f.name == field)


def refused(name, value, match=None):
    with pytest.raises(ValueError, match=match or name.replace(".", r"\.")):
        from_dict(nested(name, value))


def like(default, item):
    """The item alone, or a list of it as long as the default."""
    return [item] * len(default) if isinstance(default, tuple) else item


NO_NUMBERS = [-1, -0.5, 1e300, 10**400, math.nan, math.inf, -math.inf, True, "3", None, [], {}, [1, [2]]]


@pytest.mark.parametrize("name", NUMBERS)
def test_no_field_takes_what_is_not_a_number_in_its_bounds(name):
    for item in NO_NUMBERS:
        refused(name, like(field_of(name).default, item))


@pytest.mark.parametrize("name", NUMBERS)
def test_lists_need_their_length_and_counts_are_whole(name):
    default = field_of(name).default
    if not isinstance(default, tuple):
        refused(name, [default])
    else:
        refused(name, default[0])
        refused(name, [])
        if name != "tasks.values":
            refused(name, list(default[:-1]), "must hold")
            refused(name, [*default, default[-1]], "must hold")
    if isinstance(default, int):
        refused(name, default + 0.5)


@pytest.mark.parametrize(
    "name",
    [
        "world.canopy_height",
        "world.mountain_height",
        "tasks.difficulty",
        "tasks.deadline",
        "tasks.decay",
        "operators.capacity",
        "communication.late_delay",
    ],
)
def test_ranges_are_not_reversed(name):
    low, high = field_of(name).default
    refused(name, [high, low], "lower end")


@pytest.mark.parametrize("kind", ["telemetry", "query", "request", "control", "renewal", "reply"])
def test_messages_that_no_bucket_can_pay_for_are_refused(kind):
    refused(f"communication.{kind}_bytes", 193, "does not fit into communication.bucket")
    assert from_dict(nested(f"communication.{kind}_bytes", 192)).communication.bucket == 192


def test_the_bounds_themselves_are_possible():
    for name in NUMBERS:
        field = field_of(name)
        if name in ("communication.bucket", "communication.broadcast_bucket") or name.endswith("_bytes"):
            continue  # they bound each other
        for bound in (field.metadata["low"], field.metadata["high"]):
            if name in ("n_uav", "n_ugv", "tasks.type_shares"):
                continue
            value = like(field.default, bound)
            assert isinstance(from_dict(nested(name, value)), Scenario)


@pytest.mark.parametrize("n_uav, n_ugv", [(0, 0), (64, 1), (33, 32)])
def test_teams_have_one_to_64_robots(n_uav, n_ugv):
    with pytest.raises(ValueError, match=r"n_uav \+ n_ugv must lie in 1..64"):
        from_dict({"n_uav": n_uav, "n_ugv": n_ugv})


def test_a_team_that_cannot_do_every_task_is_legal():
    scenario = from_dict({"n_ugv": 0, "n_uav": 1, "n_operators": 0, "tasks": {"type_shares": [0, 1, 0]}})
    assert scenario.n_robots == 1 and scenario.robot_names == ["uav0"]


def test_type_shares_sum_to_one():
    refused("tasks.type_shares", [0.5, 0.5, 0.5], "tasks.type_shares must sum to 1")


@pytest.mark.parametrize(
    "table, match",
    [
        ({"n_robots": 3}, "unknown field n_robots"),
        ({"tasks": {"speed": 3}}, "unknown field tasks.speed"),
        ({"robots": 3}, "robots must be a table"),
        ({"robots": []}, "robots must be a table"),
        ({"base": "huge"}, "base must be one of small, medium, large"),
        ({"base": 3}, "base must be one of"),
        ({"name": 3}, "name must be"),
    ],
)
def test_unknown_fields_and_tables_are_refused_by_name(table, match):
    with pytest.raises(ValueError, match=match):
        from_dict(table)


def test_only_what_is_named_differs_from_the_base():
    scenario = from_dict({"base": "small", "n_tasks": 5, "tasks": {"decay": [1, 2]}})
    expected = dataclasses.replace(
        SCENARIOS["small"], n_tasks=5, tasks=dataclasses.replace(SCENARIOS["small"].tasks, decay=(1, 2))
    )
    assert scenario == expected


def test_toml_files_override_a_base(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('base = "large"\nn_uav = 3\nmap_side = 750\n[communication]\nrange = [0.2, 0.1, 0.1]\n')
    scenario = load_scenario(path)
    assert scenario == load_scenario(str(path))
    assert (scenario.n_uav, scenario.n_ugv, scenario.map_side) == (3, 8, 750)
    assert scenario.communication.range == (0.2, 0.1, 0.1)


@pytest.mark.parametrize(
    "file, name",
    [
        ("dense-3.toml", "dense-3"), ("medium.toml", "medium.toml"), ("ä large (2).toml", "large-2-"), ("-_.toml", "unnamed"),
        ("x" * 90 + ".toml", "x" * 64), ("a.b.toml", "a.b"),
    ],
)  # fmt: skip
def test_a_file_that_gives_no_name_gives_its_own(tmp_path, file, name):
    path = tmp_path / file
    path.write_text("n_uav = 3")
    assert load_scenario(path) == dataclasses.replace(SCENARIOS["medium"], n_uav=3, name=name)
    path.write_text('base = "small"')
    assert load_scenario(path) == SCENARIOS["small"], "nothing is different"
    path.write_text('base = "small"\nname = "medium"\nn_uav = 3')
    assert load_scenario(path).name == "medium", "as it says"


@pytest.mark.parametrize(
    "content, match",
    [
        (b"n_uav = ", "Invalid value"),
        (b"n_uav = -1", "n_uav must lie in 0..64"),
        (b"\xff\xfe", "decode"),
        (b"[tasks]\nspeed = 1", "unknown field tasks.speed"),
        (b"n_uav = 1\nn_uav = 2", "overwrite"),
        (b"map_side = nan", "map_side"),
        (None, "No such file"),
    ],
)
def test_bad_files_are_refused_by_their_name(tmp_path, content, match):
    path = tmp_path / "bad.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ValueError, match=match) as error:
        load_scenario(path)
    assert "bad.toml" in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["tiny", "", "small.json", "SMALL"])
def test_unknown_names_are_refused(name):
    with pytest.raises(ValueError, match="unknown scenario .*small, medium, large"):
        load_scenario(name)


@settings(max_examples=40)
@given(scenarios())
def test_json_round_trip(scenario):
    again = from_json(to_json(scenario))
    assert again == scenario and hash(again) == hash(scenario)
    assert json.loads(to_json(scenario))["n_tasks"] == scenario.n_tasks


def test_describe_lists_every_field_with_unit_mark_and_reason():
    expected = [
        f"{table}.{field.name}" for table in TABLES for field in dataclasses.fields(getattr(SCENARIOS["medium"], table))
    ]
    own = [field.name for field in dataclasses.fields(Scenario) if field.name not in TABLES]
    assert [name for name, *_ in FIELDS] == own + expected
    for name, value, unit, mark, doc in FIELDS:
        assert mark in ("P", "D", "P/D") and len(doc) > 5, name
        assert isinstance(unit, str) and (unit or not isinstance(value, int)), name
    assert dict((name, value) for name, value, *_ in describe(SCENARIOS["small"]))["n_tasks"] == 22


def test_scenarios_cannot_be_changed_in_place():
    with pytest.raises(dataclasses.FrozenInstanceError):
        SCENARIOS["small"].n_tasks = 3
    with pytest.raises(dataclasses.FrozenInstanceError):
        SCENARIOS["small"].tasks.decay = (1, 2)


def test_the_papers_numbers():
    sides = {
        name: (s.map_side, s.n_tasks, s.time_limit, s.n_uav, s.n_ugv, s.n_operators) for name, s in SCENARIOS.items()
    }
    assert sides == {
        "small": (500, 22, 600, 2, 2, 2), "medium": (1000, 56, 1200, 4, 4, 3), "large": (2000, 112, 2400, 8, 8, 6),
    }  # fmt: skip
    assert LIMITATIONS == ("nominal", "low", "high")
    for scenario in SCENARIOS.values():
        robots, operators, radio = scenario.robots, scenario.operators, scenario.communication
        assert robots.autonomous_speed == (18, 5) and robots.controlled_speed == (25, 8)
        profiles = operators.generalist, operators.uav_specialist, operators.ugv_specialist
        assert profiles == ((0.9, 0.9), (0.65, 1.2), (1.2, 0.65))
        assert radio.unavailable_or_delayed == (0.1, 0.2, 0.3) and radio.range[0] == 0.3 and radio.out_degree == 4
        assert (radio.bucket, radio.query_bytes, radio.time_to_live) == (192, 32, 24)
        assert scenario.reward.pending == 0.01 and scenario.tasks.values == (1, 2, 3)


def test_shares_that_sum_to_one_almost_exactly_can_be_drawn():
    """What validation lets pass, a world must take."""
    third = 0.3333333
    scenario = dataclasses.replace(SCENARIOS["small"], tasks=TaskRules(type_shares=(third, third, third)))
    assert len(make_world(scenario, 0).pois) == 22
