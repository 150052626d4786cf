"""What information is worth: what is flown, what is paired with what, and what the command prints."""

import dataclasses
from types import SimpleNamespace

import pytest
from strategies import change

from commhg_mj.flights.held_out import HELD_OUT
from commhg_mj.scenarios import SCENARIOS
from commhg_mj.study import information_value
from commhg_mj.study.information_value import N_FLIGHTS, SHARES, VARIANTS, measure_value, with_budget

BUSY = 1800.0  # s of an operator's control in a nominal mission


@pytest.fixture
def flown(monkeypatch):
    """Pretend that missions end by what they were given; collects what was asked for."""
    calls = []

    def fly(scenario, policy, seeds, links, limitation, out, workers, advance):
        assert list(seeds) == list(range(HELD_OUT, HELD_OUT + len(seeds)))
        calls.append((policy, links, limitation, scenario.n_operators, scenario.communication.refill))
        advance(len(seeds))
        twcr = 0.7 - 0.2 * (links == "silent") - 0.1 * (limitation == "high") - 0.15 * (scenario.n_operators == 0)
        return [
            SimpleNamespace(twcr=twcr + 0.01 * (-1) ** seed, control_time=BUSY / 3600.0, duration=3600) for seed in seeds
        ]

    monkeypatch.setattr(information_value, "fly", fly)
    return calls


def test_every_variant_flies_once_and_is_paired_with_nominal(flown):
    told = []
    worth = measure_value(SCENARIOS["small"], "planner", 4, "abstract", advance=told.append)
    assert len(flown) == len(set(flown)) == N_FLIGHTS and sum(told) == 4 * N_FLIGHTS
    assert worth.nominal.mean == pytest.approx(0.7) and len(worth.differences) == len(VARIANTS) - 1
    silent = worth.differences["silent: nothing is delivered"]
    assert tuple(silent) == pytest.approx((-0.2,) * 3), "what all missions share cancels"
    assert worth.differences["high limitation"].mean == pytest.approx(-0.1)
    assert list(worth.budget) == sorted([*SHARES, 1.0]) and worth.budget[1.0] == worth.nominal
    # Two operators, half an hour each: .15 in one hour.
    assert worth.per_hour.mean == pytest.approx(0.15)


def test_a_budget_is_a_share_of_every_refill():
    rules = with_budget(SCENARIOS["medium"], 0.5).communication
    before = SCENARIOS["medium"].communication
    assert (rules.refill, rules.broadcast_refill) == (before.refill / 2, before.broadcast_refill / 2)
    assert dataclasses.replace(rules, refill=before.refill, broadcast_refill=before.broadcast_refill) == before


def test_privileged_and_unknown_policies_are_refused_by_name():
    with pytest.raises(ValueError, match="policy omniscient: privileged"):
        measure_value(SCENARIOS["small"], "omniscient", 2, "abstract")
    with pytest.raises(ValueError, match="nobody"):
        measure_value(SCENARIOS["small"], "nobody", 2, "abstract")


def test_less_is_worth_less_and_all_is_worth_most():
    """Really flown: silence costs, and nobody gains by hearing nothing."""
    scenario = change(SCENARIOS["small"], time_limit=300)
    worth = measure_value(scenario, "planner", 24, "abstract")
    assert worth.differences["silent: nothing is delivered"].high < 0.0
    assert worth.differences["perfect links"].mean > worth.differences["silent: nothing is delivered"].mean


def test_the_command_prints_tables_and_draws(run, tmp_path):
    (tmp_path / "tiny.toml").write_text('base = "small"\nname = "tiny"\nn_tasks = 5\ntime_limit = 40\n')
    code, out, _ = run("value", "--policy", "greedy", "planner", "--scenario", "tiny.toml", "--missions", 2, "--workers", 1,
                       "--out", "value.png")  # fmt: skip
    assert code == 0 and (tmp_path / "value.png").stat().st_size > 5000
    for words in ("greedy, tiny", "planner, tiny", "everything known", "25%", "per hour of control"):
        assert words in out


@pytest.mark.parametrize("arguments, said", [
    (("--policy", "omniscient"), "policy omniscient"),
    (("--policy", "nobody"), "nobody"),
    (("--scenario", "medum"), "medum"),
    (("--links", "radar"), "radar"),
    (("--missions", 1), "missions"),
    (("--out", "value.jpeg/x"), "value.jpeg"),
])  # fmt: skip
def test_bad_input_is_one_line(run, arguments, said):
    code, out, error = run("value", *arguments)
    assert code == 2 and out == "" and said in error and len(error.strip().splitlines()) == 1
