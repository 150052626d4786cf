"""Statistics of links, each against a slow and plain way to compute it."""

import itertools

import numpy as np
import pytest

from commhg_mj.planning.link_pairs import CLASSES, PAIR
from commhg_mj.study.comparison.sight import (
    BLOCKAGE,
    area_under_roc,
    blockage_rows,
    blockages,
    calibration_error,
    foresight,
    implied_loss,
    is_clear,
    link_rows,
    reliability,
)


def made_links(n, seed=0):
    """PAIR rows with every combination of sights and classes."""
    rng, rows = np.random.default_rng(seed), np.zeros(n, PAIR)
    rows["kind"], rows["in_range"] = rng.integers(0, 4, n), True
    rows["planar_forest"] = rng.exponential(40, n) * (rng.random(n) < 0.4)
    rows["planar_mountain"] = rng.exponential(10, n) * (rng.random(n) < 0.2)
    rows["planar_passing"] = np.exp(-rows["planar_forest"] / 73 - rows["planar_mountain"] / 10)
    rows["planar_delivered"], rows["fit_delivered"] = 0.95 * rows["planar_passing"], 0.95 * rows["planar_passing"] ** 0.3
    rows["ray_forest"] = rng.exponential(30, n) * (rng.random(n) < 0.3)
    rows["ray_blocked"] = rng.random(n) < 0.15
    rows["ray_excess"] = 0.4 * rows["ray_forest"] + 20 * rows["ray_blocked"] * (1 + rng.random(n))
    rows["ray_delivered"] = 0.95 * rng.random(n)
    return rows


def test_half_the_packets_use_up_one_margin():
    passing = np.array([1.0, 0.5, 0.25, 0.9, 1e-30, 0.0])
    np.testing.assert_allclose(implied_loss(passing, 15.0), [0, 15, 30, -15 * np.log(0.9) / np.log(2), 40, 40])
    assert implied_loss(np.float32(0.5), 3.0) == 3.0


def test_clear_means_nothing_between():
    rows = np.zeros(5, PAIR)
    rows["planar_forest"], rows["planar_mountain"] = [0, 1, 0, 0, 0], [0, 0, 1, 0, 0]
    rows["ray_forest"], rows["ray_blocked"] = [0, 0, 0, 1, 0], [0, 0, 0, 0, 1]
    assert is_clear(rows, "abstract").tolist() == [True, False, False, True, True]
    assert is_clear(rows, "raycast").tolist() == [True, True, True, False, False]


def brute_force_auc(foretold, heard):
    wins = [(a > b) + 0.5 * (a == b) for a in foretold[heard] for b in foretold[~heard]]
    return sum(wins) / len(wins)


def brute_force_bins(foretold, heard):
    """{bin: [(foretold, heard)]} of ten equal bins, the last one closed."""
    bins = {}
    for p, fate in zip(foretold, heard):
        index = next(i for i in range(10) if p < (i + 1) / 10 or i == 9)
        bins.setdefault(index, []).append((p, fate))
    return bins


@pytest.mark.parametrize("n, levels", [(2, None), (60, None), (80, 4), (50, 1)])
def test_auc_brier_and_ece_against_brute_force(n, levels):
    rng = np.random.default_rng(n)
    foretold = rng.random(n) if levels is None else rng.integers(0, levels, n) / 3.5 + 0.02
    heard = rng.random(n) < np.clip(foretold, 0.1, 0.9)
    heard[:2] = True, False
    assert area_under_roc(foretold, heard) == pytest.approx(brute_force_auc(foretold, heard))
    bins = brute_force_bins(foretold, heard)
    ece = sum(len(each) / n * abs(np.mean([p for p, _ in each]) - np.mean([fate for _, fate in each])) for each in bins.values())
    assert calibration_error(foretold, heard) == pytest.approx(ece)
    assert [count for *_, count in reliability(foretold, heard)] == [len(bins[i]) for i in sorted(bins)]
    found = foresight(foretold, heard, "_x")
    assert set(found) == {"brier_x", "ece_x", "auc_x"}
    assert found["brier_x"] == pytest.approx(sum((p - fate) ** 2 for p, fate in zip(foretold, heard)) / n)


def test_probability_one_is_in_the_last_bin():
    assert reliability(np.array([1.0, 0.95, 0.0]), np.array([True, False, False])) == [(0, 0, 1), (0.975, 0.5, 2)]


def test_a_perfect_and_a_useless_prophet():
    heard = np.array([True, True, False, False])
    assert area_under_roc(np.array([0.9, 0.8, 0.2, 0.1]), heard) == 1
    assert area_under_roc(np.array([0.1, 0.2, 0.8, 0.9]), heard) == 0
    assert area_under_roc(np.full(4, 0.5), heard) == 0.5
    for fate in (True, False):
        assert np.isnan(area_under_roc(np.full(4, 0.5), np.full(4, fate)))


def test_link_rows_against_sums_over_links():
    links = made_links(800)
    rows = {row["links"]: row for row in link_rows(links, 15.0)}
    assert list(rows) == [*CLASSES, "robot-robot", "all"]
    members = {name: [row for row in links if row["kind"] == k] for k, name in enumerate(CLASSES)}
    members["robot-robot"] = [row for row in links if row["kind"] < 3]
    members["all"] = list(links)
    for name, ours in members.items():
        row, n = rows[name], len(ours)
        sights, errors = {}, []
        for link in ours:
            flat = link["planar_forest"] == link["planar_mountain"] == 0
            cast = link["ray_forest"] == 0 and not link["ray_blocked"]
            sights[flat, cast] = sights.get((flat, cast), 0) + 1
            planar_loss = min(40.0, 15.0 * np.log2(1 / link["planar_passing"]))
            errors.append(planar_loss - min(40.0, link["ray_excess"]))
        names = {(True, True): "both_clear", (True, False): "only_abstract_clear",
                 (False, True): "only_raycast_clear", (False, False): "both_obstructed"}  # fmt: skip
        assert row["samples"] == n
        for sight, title in names.items():
            assert row[title] == pytest.approx(sights.get(sight, 0) / n)
        assert row["excess_bias_db"] == pytest.approx(sum(errors) / n, abs=1e-4)
        assert row["excess_rmse_db"] == pytest.approx((sum(e * e for e in errors) / n) ** 0.5, abs=1e-4)
        worst = sorted(map(abs, errors))
        assert worst[int(0.9 * (n - 1))] - 1e-4 <= row["excess_p90_db"] <= worst[int(0.9 * (n - 1)) + 1] + 1e-4
        for column, field in (("abstract", "planar"), ("abstract_fit", "fit"), ("raycast", "ray")):
            assert row[f"delivered_{column}"] == pytest.approx(np.mean([link[f"{field}_delivered"] for link in ours]), abs=1e-5)


def test_a_true_forecast_has_a_small_calibration_error():
    """Fates are drawn from the ray-cast delivery: foretelling just that is calibrated, its square is not."""
    links = made_links(20_000)
    links["planar_delivered"], links["fit_delivered"] = links["ray_delivered"], links["ray_delivered"] ** 2
    row = link_rows(links, 15.0)[-1]
    assert row["ece"] < 0.02 < 0.1 < row["ece_fit"] and row["brier"] < row["brier_fit"]
    variance = np.mean(links["ray_delivered"] * (1 - links["ray_delivered"]))
    assert row["brier"] == pytest.approx(variance, abs=0.005)
    assert row["auc"] == pytest.approx(row["auc_fit"]), "a monotone change keeps every order"


def test_classes_without_links_have_no_row():
    links = made_links(50)
    links["kind"] = 3
    assert [row["links"] for row in link_rows(links, 15.0)] == ["robot-station", "all"]


def history(kind, a, b, first, flat, cast):
    """A pair's seconds from `first` on: '#' obstructed, '.' clear, ' ' out of range, under both models."""
    rows = []
    for i, (planar, rays) in enumerate(zip(flat, cast)):
        assert (planar == " ") == (rays == " ")
        if planar != " ":
            row = np.zeros(1, PAIR)
            row["time"], row["a"], row["b"], row["kind"] = first + i, a, b, kind
            row["planar_forest"], row["ray_blocked"] = planar == "#", rays == "#"
            rows.append(row)
    return np.concatenate(rows)


def test_blockages_of_a_hand_made_sequence():
    """Two pairs, side by side in time: clear gaps, exits from the range, the mission's start and end."""
    links = np.concatenate([
        history(0, 0, 1, 0, "##.###  ##..#", "..#.##  ###.."),
        history(2, 2, 3, 0, "#############", "............."),
        history(3, 0, 4, 3, ".#.#         ##", "####         .#"),
    ])  # fmt: skip
    for order in (np.argsort(links["time"], kind="stable"), np.random.default_rng(1).permutation(len(links))):
        found = blockages(links[order])
        episodes = sorted((int(row["kind"]), bool(row["is_planar"]), int(row["seconds"])) for row in found)
        assert episodes == sorted(
            [(0, True, 2), (0, True, 3), (0, True, 2), (0, True, 1), (0, False, 1), (0, False, 2), (0, False, 3)]
            + [(2, True, 13)]
            + [(3, True, 1), (3, True, 1), (3, True, 2), (3, False, 4), (3, False, 1)]
        )


@pytest.mark.parametrize("seed", range(4))
def test_blockages_against_walking_along_every_pair(seed):
    rng, parts = np.random.default_rng(seed), []
    for a, b in itertools.combinations(range(4), 2):
        flat, cast = ("".join(rng.choice(list("#."), 30)) for _ in range(2))
        away = rng.random(30) < 0.2
        flat, cast = ("".join(" " if gone else sign for sign, gone in zip(signs, away)) for signs in (flat, cast))
        parts.append((flat, cast, history(int(rng.integers(4)), a, b, 7, flat, cast)))
    found = blockages(np.concatenate([rows for *_, rows in parts]))
    for is_planar in (True, False):
        runs = [len(run) for flat, cast, _ in parts for run in (flat if is_planar else cast).replace(" ", ".").split(".") if run]
        # A run that leaves the range and comes back is two: spaces and dots both end it.
        assert sorted(found["seconds"][found["is_planar"] == is_planar]) == sorted(runs)


def test_no_links_and_no_blockages():
    assert len(blockages(np.zeros(0, PAIR))) == 0 and blockage_rows(np.zeros(0, BLOCKAGE)) == []
    assert len(blockages(history(1, 0, 1, 0, "...", "..."))) == 0


def test_blockage_rows():
    found = np.zeros(6, BLOCKAGE)
    found["kind"], found["is_planar"] = [0, 0, 0, 0, 3, 3], [True, True, True, False, False, False]
    found["seconds"] = [1, 2, 6, 9, 4, 8]
    assert blockage_rows(found) == [
        {"links": "UAV-UAV", "model": "abstract", "episodes": 3, "mean_s": 3.0, "median_s": 2.0, "p90_s": pytest.approx(5.2)},
        {"links": "UAV-UAV", "model": "raycast", "episodes": 1, "mean_s": 9.0, "median_s": 9.0, "p90_s": 9.0},
        {"links": CLASSES[3], "model": "raycast", "episodes": 2, "mean_s": 6.0, "median_s": 6.0, "p90_s": pytest.approx(7.6)},
    ]
