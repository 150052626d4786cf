"""Tables, bounds and choices of any scenario, along random flights."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from playing import BRIEF, Dice, Ledger, decisions_of, open_everywhere
from strategies import limitations, link_models, scenarios, seeds

from commhg_mj.mission.batch import MissionBatch
from commhg_mj.scenarios import SCENARIOS
from commhg_mj.tasks.choices import Choices
from commhg_mj.tasks.columns import COLUMNS, INDICES, RECORDS, ROWS, table_bounds, table_shape
from commhg_mj.tasks.spaces import team_space
from commhg_mj.tasks.tables import Tables, new_tables
from commhg_mj.tasks.team import Team

every_scenario = pytest.mark.parametrize("scenario", SCENARIOS)


def beyond(team, bounds):
    """{table/column: (lowest, highest)} of what lies outside its bounds."""
    found = {}
    for table, array in team.tables._asdict().items():
        rows = array.reshape(-1, array.shape[-1])
        if len(rows):
            ends, (low, high) = (rows.min(axis=0), rows.max(axis=0)), bounds[table]
            for k in np.flatnonzero(~((ends[0] >= low) & (ends[1] <= high))):
                found[f"{table}/{COLUMNS[table][k]}"] = (ends[0][k], ends[1][k], low[k], high[k])
    return found


@settings(max_examples=25)
@given(scenarios(), seeds, limitations, link_models, st.sampled_from([0, 0, 0, 1, 13]), st.sampled_from([0.0, 0.5, 0.9]))
def test_everything_lies_within_its_bounds(scenario, seed, limitation, links, period, stays):
    team = Team(scenario, links, limitation, period)
    team.begin([seed])
    dice, bounds = Dice(scenario, seed % 100, stays), {table: table_bounds(table, scenario) for table in ROWS}
    for _ in range(60 if scenario.n_robots == 64 else 300):
        assert beyond(team, bounds) == {}
        assert 0 <= team.elapsed[0] <= team.time[0] <= scenario.time_limit
        if team.over[0]:
            break
        team.step(dice.open(team.mask))
        assert team.replaced[0] == 0


@settings(max_examples=12)
@given(scenarios(), seeds, st.booleans())
def test_tables_masks_and_choices_are_what_observations_say(scenario, seed, obeys):
    team, batch = Team(scenario), MissionBatch(scenario, [seed, seed + 1 if seed < 2**62 else 0])
    team.begin(batch.seeds)
    dice, ledger = Dice(scenario), Ledger(2, scenario)
    ledger.note(batch.observations)
    for _ in range(6 if scenario.n_robots == 64 else 30):
        for name, table in ledger.tables._asdict().items():
            np.testing.assert_array_equal(getattr(team.tables, name), table, name, strict=True)
        np.testing.assert_array_equal(team.mask, ledger.mask)
        np.testing.assert_array_equal(team.due, ledger.due)
        actions = dice.open(team.mask) if obeys else dice.any((2,))
        masked = np.where(team.over, 0, np.sum(~open_everywhere(team.mask, actions, scenario), axis=1))
        decisions = decisions_of(batch.observations, actions)
        team.step(actions)
        ledger.note(batch.step(decisions))
        assert team.replaced.tolist() == masked.tolist()
        np.testing.assert_array_equal(team.time, batch.time)
        np.testing.assert_array_equal(team.rewards, batch.rewards.sum(axis=1))


@every_scenario
def test_every_space_has_room(scenario):
    """Bounds are finite, in order, and apart."""
    for table in ROWS:
        low, high = table_bounds(table, SCENARIOS[scenario])
        assert low.dtype == high.dtype == np.float32 and np.isfinite([low, high]).all() and np.all(low < high), table


@every_scenario
def test_spaces_fit_tables_choices_and_samples(scenario):
    numbers = SCENARIOS[scenario]
    choices, tables = Choices(numbers), new_tables(2, numbers)
    space = team_space(numbers, choices)
    assert set(space) == {*ROWS, "due", "time", "elapsed", "action_mask"}
    for name in ROWS:
        assert (2, *space[name].shape) == getattr(tables, name).shape == (2, *table_shape(name, numbers))
    assert space.contains(space.sample()) and space["action_mask"].n == choices.n_numbers == sum(choices.sizes)


def test_every_column_of_the_observations_has_its_place():
    assert Tables._fields == tuple(ROWS) == tuple(COLUMNS) == tuple(RECORDS)
    for table, record in RECORDS.items():
        columns = COLUMNS[table]
        assert len(set(columns)) == len(columns)
        whole = {name.removesuffix("_uav").removesuffix("_ugv") if name.startswith("prof") else name for name in columns}
        assert whole == set(record.names) - set(INDICES.get(table, ())), table


@every_scenario
def test_flat_masks_come_apart_into_choices(scenario):
    choices = Choices(SCENARIOS[scenario])
    assert len(choices.names) == len(choices.sizes) == len(choices.starts) and len(set(choices.names)) == len(choices.names)
    parts = choices.split(np.arange(3 * choices.n_numbers).reshape(3, -1))
    assert [part.shape for part in parts] == [(3, size) for size in choices.sizes]
    np.testing.assert_array_equal(np.concatenate(parts, axis=1), np.arange(3 * choices.n_numbers).reshape(3, -1))
    view = choices.split(np.zeros(choices.n_numbers))
    view[0][0] = 1
    assert view[0].base is not None, "no copies"


def test_rows_wait_for_their_actors():
    """The tables of who is not due are those of his last turn, whatever has happened since."""
    team, dice, stood = Team(BRIEF), Dice(BRIEF), 0
    team.begin([3])
    while not team.over[0]:
        before = Tables(*(table.copy() for table in team.tables))
        team.step(dice.open(team.mask))
        robots, operators = np.split(team.due[0] == 0, [BRIEF.n_robots])
        for name, table in team.tables._asdict().items():
            waits = robots if name.startswith("robot") else operators
            np.testing.assert_array_equal(table[0][waits], getattr(before, name)[0][waits])
            stood += waits.sum()
    assert stood > 100 and not team.due.any()
