"""The fit finds the decay lengths that made the links, and no others are likelier."""

import numpy as np
import pytest
from rich.console import Console
from strategies import change

from commhg_mj.cli.tables.one_link import fit_table
from commhg_mj.flights.fly import fly_recorded
from commhg_mj.flights.held_out import CALIBRATION, FIT, HELD_OUT
from commhg_mj.planning import decay_fit as fit
from commhg_mj.planning.link_pairs import PAIR, links_of
from commhg_mj.scenarios import SCENARIOS

TINY = change(SCENARIOS["small"], name="tiny", n_tasks=8, time_limit=60, forest_share=0.3, n_forests=8, uav_height=12.0)


def synthetic(n, forest_decay, mountain_decay, clear, seed=0):
    """PAIR rows of links whose delivery is what a planar model with these decays says."""
    rng, rows = np.random.default_rng(seed), np.zeros(n, PAIR)
    rows["planar_forest"] = rng.exponential(60, n) * (rng.random(n) < 0.5)
    rows["planar_mountain"] = rng.exponential(15, n) * (rng.random(n) < 0.3)
    loss = rows["planar_forest"] / forest_decay + rows["planar_mountain"] / mountain_decay
    rows["ray_delivered"] = clear * np.exp(-loss)
    return rows


@pytest.fixture
def flown(monkeypatch):
    """Give `fit` links that nobody flew; collects what it asked for."""
    asked = {}

    def pretend(parts):
        def fly_recorded(look, scenario, policy, seeds, links="abstract", limitation="nominal", workers=1, advance=None):
            asked.update(scenario=scenario, policy=policy, seeds=list(seeds), links=links, limitation=limitation, workers=workers)
            return parts

        monkeypatch.setattr(fit, "fly_recorded", fly_recorded)
        return asked

    return pretend


@pytest.mark.parametrize(
    "forest, mountain, clear", [(73.0, 10.0, 0.95), (480.0, 150.0, 0.9), (20.0, 3.0, 0.85), (5000.0, 5.0, 1.0)]
)
def test_it_finds_the_decays_that_made_the_links(flown, forest, mountain, clear):
    flown([synthetic(2000, forest, mountain, clear, seed) for seed in range(3)])
    found = fit.fit(TINY)
    assert (found.forest_decay, found.mountain_decay) == (pytest.approx(forest, rel=0.01), pytest.approx(mountain, rel=0.01))
    assert (found.scenario, found.links) == ("tiny", 6000)


def test_likelihoods_are_nats_a_link(flown):
    rows = synthetic(500, 200.0, 40.0, 0.95)
    flown([rows])
    found = fit.fit(TINY)

    def likelihood(forest, mountain):
        total = 0.0
        for row in rows:
            q = 0.95 * np.exp(-row["planar_forest"] / forest - row["planar_mountain"] / mountain)
            total += row["ray_delivered"] * np.log(q) + (1 - row["ray_delivered"]) * np.log(1 - q)
        return total / len(rows)

    assert found.log_likelihood == pytest.approx(likelihood(200, 40), abs=1e-4)
    assert found.own_log_likelihood == pytest.approx(likelihood(73, 10), abs=1e-4)
    assert found.own_log_likelihood < found.log_likelihood


def test_it_flies_missions_of_its_own(flown):
    asked = flown([synthetic(50, 70, 10, 0.95)])
    fit.fit(TINY, 5, workers=3)
    assert asked["scenario"] is TINY and asked["workers"] == 3
    assert (asked["policy"], asked["links"], asked["limitation"]) == ("greedy", "raycast", "nominal")
    assert len(set(asked["seeds"])) == 5
    ranges = sorted((first, first + 5000) for first in (FIT, CALIBRATION, HELD_OUT))
    assert all(end <= start for (_, end), (start, _) in zip(ranges, ranges[1:]))
    assert asked["seeds"] == list(range(FIT, FIT + 5))


def test_links_between_robots_in_range_count():
    (links,), (rows,) = (fly_recorded(look, TINY, "greedy", [5], "raycast") for look in (fit._links, links_of))
    expected = [row for row in rows if row["b"] < 4 and row["in_range"] and row["time"] % 5 == 0]
    assert links.tolist() == [row.tolist() for row in expected] and 0 < len(links)


def test_no_decays_are_likelier_on_real_links():
    ended = []
    found = fit.fit(TINY, 3, advance=ended.append)
    assert sum(ended) == 3
    parts = fly_recorded(fit._links, TINY, "greedy", range(FIT, FIT + 3), "raycast")
    links = np.concatenate(parts)
    assert found.links == len(links) and np.any(links["planar_forest"] > 0)
    q = links["ray_delivered"].astype(float)
    forests, mountains = np.meshgrid(np.geomspace(1, 1e5, 60), np.geomspace(0.5, 1e4, 60))
    p = 0.95 * np.exp(-links["planar_forest"] / forests[..., None] - links["planar_mountain"] / mountains[..., None])
    p = np.clip(p, 1e-9, 1)
    likelihoods = np.mean(q * np.log(p) + (1 - q) * np.log(1 - p), axis=-1)
    assert likelihoods.max() <= found.log_likelihood + 1e-6
    assert found.own_log_likelihood <= found.log_likelihood


def test_the_table_holds_every_fit(capsys):
    fits = [fit.Fit("one", 73.04, 10.0, -0.25, -0.3125, 1234), fit.Fit("two", 500.0, 99.96, -0.5, -0.75, 7)]
    Console(width=200).print(fit_table(fits))
    lines = capsys.readouterr().out.splitlines()
    one, two = (next(line for line in lines if line.startswith(f"| {name}")) for name in ("one", "two"))
    assert [cell.strip() for cell in one.split("|")[1:-1]] == ["one", "73.0", "10.0", "1,234", "-0.3125, -0.2500"]
    assert [cell.strip() for cell in two.split("|")[1:-1]] == ["two", "500.0", "100.0", "7", "-0.7500, -0.5000"]
