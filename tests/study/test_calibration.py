"""The calibration rules: what is flown, and what is judged."""

from types import SimpleNamespace

import numpy as np
import pytest

from commhg_mj.cli.tables.calibrate import calibration_tables
from commhg_mj.flights.held_out import CALIBRATION
from commhg_mj.scenarios import SCENARIOS, from_dict
from commhg_mj.study import calibration
from commhg_mj.study.calibration import CORRECTIONS, N_FLIGHTS, calibrate

GOOD = {
    "random": 0.2, "greedy+no-query": 0.6, "greedy+no-query high": 0.5, "greedy+no-query low": 0.55,
    "greedy+no-query alone": 0.5, "greedy": 0.61, "greedy high": 0.52, "cbba": 0.65, "planner": 0.7, "planner high": 0.66,
    "omniscient": 0.8, "omniscient alone": 0.7, "planner perfect": 0.75, "planner+no-broadcast": 0.6, "planner+no-query": 0.695,
    "planner+no-query high": 0.64, "planner+always-asks": 0.66,
    "planner+broadcasts-every-30.0": 0.5, "planner+broadcasts-every-15.0": 0.68,  # half the bytes: half the period
    "planner+broadcasts-at-random-0.300": 0.5, "planner+broadcasts-at-random-0.150": 0.68,  # twice the bytes: half the chance
    "planner+asks-at-random-0.100 high": 0.5, "planner+asks-at-random-0.200 high": 0.645,  # likewise
}
QUERIES = {"planner": 20, "planner+asks-at-random-0.100": 10, "planner+asks-at-random-0.200": 20}
BYTES = {
    "planner": 2000, "planner+broadcasts-every-30.0": 1000, "planner+broadcasts-every-15.0": 2000,
    "planner+broadcasts-at-random-0.300": 4000, "planner+broadcasts-at-random-0.150": 2000,
}  # fmt: skip


@pytest.fixture
def flown(monkeypatch):
    """Pretend that every mission ends with a given TWCR; collects what was asked for."""
    calls, levels = [], dict(GOOD)

    def fly(scenario, policy, seeds, links="abstract", limitation="nominal", out=None, workers=1, advance=None):
        suffix = " alone" if scenario.n_operators == 0 else f" {limitation}" if limitation != "nominal" else ""
        suffix += " perfect" if links == "perfect" else ""
        calls.append((scenario, policy, tuple(seeds), limitation))
        advance(len(seeds))
        messages = {"query": {"attempted": QUERIES.get(policy, 0)}, "broadcast": {"bytes": BYTES.get(policy, 0)}}
        return [SimpleNamespace(twcr=levels[policy + suffix] + 0.01 * (-1) ** seed, messages=messages) for seed in seeds]

    monkeypatch.setattr(calibration, "fly", fly)
    return SimpleNamespace(calls=calls, levels=levels)


def test_all_references_fly_the_same_missions(flown):
    ended = []
    result = calibrate("small", 4, advance=ended.append)
    assert len(flown.calls) == N_FLIGHTS == len(result.twcr) + CORRECTIONS * 3 and sum(ended) == 4 * N_FLIGHTS
    assert {seeds for *_, seeds, _ in flown.calls} == {tuple(range(CALIBRATION, CALIBRATION + 4))}
    assert sum(scenario.n_operators == 0 for scenario, *_ in flown.calls) == 2
    assert {scenario.name for scenario, *_ in flown.calls} == {SCENARIOS["small"].name}
    assert result.scenario == "small"
    levels = {"random": 0.2, "greedy+no-query, high": 0.5, "greedy, high": 0.52, "omniscient, no operators": 0.7}
    for label, level in levels.items():
        assert result.twcr[label].mean == pytest.approx(level)


@pytest.mark.parametrize(
    "changes, broken",
    [
        ({}, []),
        ({"greedy+no-query": 0.44, "greedy+no-query high": 0.3}, [0]),
        ({"greedy+no-query": 0.71, "omniscient": 0.9}, [0]),
        ({"omniscient": 0.74, "omniscient alone": 0.6}, [1]),
        ({"omniscient alone": 0.76}, [2]),
        ({"greedy+no-query high": 0.58}, [3]),
        ({"greedy": 0.9, "greedy high": 0.9}, []),
        ({"planner+no-broadcast": 0.63}, [4]),
        ({"planner perfect": 0.71}, [5]),
        ({"planner+broadcasts-every-15.0": 0.695, "planner+broadcasts-every-30.0": 0.0}, [6]),
        ({"planner+always-asks": 0.7}, [7]),
        ({"planner+no-query high": 0.655}, [8]),
        ({"planner+no-query high": 0.66}, [8, 9]),
        ({"planner+broadcasts-at-random-0.150": 0.695, "planner+broadcasts-at-random-0.300": 0.0}, [10]),
        ({"planner+asks-at-random-0.200 high": 0.655}, [11]),
    ],
)
def test_the_rules(flown, changes, broken):
    flown.levels.update(changes)
    result = calibrate("medium", 4)
    assert [i for i, rule in enumerate(result.rules) if not rule.holds] == broken


def test_differences_are_paired(flown):
    """What all missions share cancels: the interval of a constant difference is a point."""
    gap = calibrate("small", 6).rules[1].measured
    assert (gap.low, gap.high) == pytest.approx((gap.mean, gap.mean)) and gap.mean == pytest.approx(0.2)


def test_tables_hold_every_flight_and_verdict(flown):
    flown.levels["greedy+no-query high"] = 0.59
    results = [calibrate(name, 2) for name in SCENARIOS]
    figures, rules = calibration_tables(results, 2)
    assert [column.header for column in figures.columns][1:] == list(SCENARIOS)
    assert list(figures.columns[0].cells) == list(results[0].twcr)
    for result, column in zip(results, rules.columns[1:]):
        verdicts = list(column.cells)
        expected = ["holds", "holds", "holds", "BROKEN", *["holds"] * 8]
        if result.scenario == "small":  # three lines are of larger teams
            expected[4] = expected[8] = expected[9] = "not asked"
        assert [cell.split(":")[0] for cell in verdicts] == expected
        assert all(str(rule.measured) in cell for rule, cell in zip(result.rules, verdicts))


def test_it_really_flies(monkeypatch):
    tiny = from_dict({"base": "small", "name": "tiny", "n_tasks": 4, "time_limit": 40})
    monkeypatch.setitem(SCENARIOS, "small", tiny)
    result = calibrate("small", 3)
    assert all(0 <= interval.low <= interval.mean <= interval.high <= 1 for interval in result.twcr.values())
    assert all(np.isfinite(rule.measured).all() for rule in result.rules)
