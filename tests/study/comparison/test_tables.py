"""The comparison's tables, from hand-made mission records; and what sentences make of them."""

import csv
import itertools

import numpy as np
import pytest

from commhg_mj.base.terms import Kind
from commhg_mj.flights.statistics import mean_interval
from commhg_mj.scenarios import SCENARIOS
from commhg_mj.study.comparison import record_tables as tables
from commhg_mj.study.comparison import report
from commhg_mj.study.comparison.figures import latency_figure
from commhg_mj.study.comparison.findings import _change, _delivery, sentences
from commhg_mj.study.comparison.message_counts import LONGEST, ROUTES
from commhg_mj.study.comparison.plan import MODELS, SHUFFLED, SWEEPS, own_value, plan

MAIN = [*MODELS, SHUFFLED]
KINDS = [kind.name.lower() for kind in Kind]


def mission(seed, rng, twcr=None, digest="same"):
    """A record as mission_record makes it, of random numbers."""
    record = {name: float(rng.random()) for name in tables.METRICS} | {"seed": seed, "digest": digest, "components": [1, 2]}
    record |= {"fatigue": 0.1, "malfunctions": 0, "duration": 60, "bytes_sent": 1000}
    record["twcr"] = float(rng.random()) if twcr is None else twcr
    for kind in KINDS:
        record[f"{kind}_ended"] = int(rng.integers(0, 9)) if kind != "reply" else 0
        record[f"{kind}_delivered"] = int(rng.integers(0, record[f"{kind}_ended"] + 1))
    record["latency"] = {}
    for route in ROUTES:
        counts = np.zeros(LONGEST + 1, int)
        counts[:9] = rng.integers(0, 5, 9)
        expired = int(rng.integers(0, 4))
        record["latency"][route] = {
            "delivered_after": counts.tolist(), "expired": expired, "ended": int(counts.sum()) + expired + 2,
        }  # fmt: skip
    return record


@pytest.fixture(scope="module")
def results():
    rng = np.random.default_rng(3)
    labels = [condition.label for condition in plan(SCENARIOS["small"], ["greedy", "random"], 5)]
    return {label: [mission(seed, rng) for seed in range(5)] for label in labels}


@pytest.fixture(scope="module")
def conditions():
    return plan(SCENARIOS["small"], ["greedy", "random"], 5)


def test_metric_rows_are_means_and_paired_differences(results):
    rows = tables.metric_rows(results, MAIN)
    assert len(rows) == len(MAIN) * len(tables.METRICS) and len({(row["condition"], row["metric"]) for row in rows}) == len(rows)
    for row in rows:
        values = [record[row["metric"]] for record in results[row["condition"]]]
        differences = [value - record[row["metric"]] for value, record in zip(values, results["abstract"])]
        assert row["mean"] == pytest.approx(np.mean(values)) and row["low"] <= row["mean"] <= row["high"]
        assert row["difference"] == pytest.approx(np.mean(differences), abs=1e-12)
        assert min(differences) - 1e-9 <= row["difference_low"] <= row["difference_high"] <= max(differences) + 1e-9
        if row["condition"] == "abstract":
            assert row["difference"] == row["difference_low"] == row["difference_high"] == 0
    assert {row["title"] for row in rows} == set(tables.METRICS.values())


def test_paired_differences_are_sharper_than_unpaired_ones():
    """What a mission shares under both models cancels."""
    rng = np.random.default_rng(0)
    base = [mission(seed, rng) for seed in range(6)]
    results = {"abstract": base, "raycast": [{**record, "twcr": record["twcr"] - 0.125} for record in base]}
    row = next(row for row in tables.metric_rows(results, ["raycast"]) if row["metric"] == "twcr")
    assert (row["difference"], row["difference_low"], row["difference_high"]) == pytest.approx((-0.125,) * 3)
    assert row["high"] - row["low"] > 0.1


def test_message_rows_are_means_of_missions_that_sent(results):
    rows = {(row["condition"], row["kind"]): row for row in tables.message_rows(results, MAIN)}
    assert set(rows) == set(itertools.product(MAIN, KINDS)) - {(label, "reply") for label in MAIN}, "nobody sent a reply"
    for (label, kind), row in rows.items():
        counts = [(record[f"{kind}_delivered"], record[f"{kind}_ended"]) for record in results[label]]
        assert row["delivered"] == pytest.approx(np.mean([delivered / ended for delivered, ended in counts if ended]))
        assert row["messages"] == pytest.approx(sum(ended for _, ended in counts) / 5)


@pytest.mark.parametrize("route", ROUTES)
def test_latency_curves_are_monotone_and_end_at_what_was_delivered(results, route):
    for label in MAIN:
        curve = tables.latency_curves(results[label], route)
        each = [record["latency"][route] for record in results[label]]
        delivered, ended = sum(sum(one["delivered_after"]) for one in each), sum(one["ended"] for one in each)
        assert len(curve) == LONGEST + 1 and np.all(np.diff(curve) >= 0) and 0 <= curve[0]
        assert delivered < ended and curve[-1] == pytest.approx(delivered / ended)
        (row,) = (row for row in tables.latency_rows(results, MAIN) if (row["condition"], row["route"]) == (label, route))
        for seconds in (1, 2, 5, 10, 30, 60):
            within = sum(sum(one["delivered_after"][: seconds + 1]) for one in each)
            assert row[f"within_{seconds}_s"] == pytest.approx(within / ended)
        assert row["expired"] == pytest.approx(sum(one["expired"] for one in each) / ended)


def test_the_latency_figure_draws_the_curves(results):
    figure = latency_figure(results)
    for ax, route in zip(figure.axes, ROUTES):
        lines = {line.get_label(): line.get_ydata() for line in ax.lines}
        assert list(lines) == MAIN
        np.testing.assert_allclose(lines["raycast"], tables.latency_curves(results["raycast"], route))


def test_no_messages_no_latencies():
    silent = {"latency": {route: {"delivered_after": [0] * (LONGEST + 1), "expired": 0, "ended": 0} for route in ROUTES}}
    assert not tables.latency_curves([silent], "robots").any()
    assert {row["expired"] for row in tables.latency_rows({"raycast": [silent]}, ["raycast"])} == {0}


def test_sweeps_hold_the_own_value_with_difference_0(results, conditions):
    rows = tables.sweep_rows(results, conditions, SCENARIOS["small"])
    own = {"foliage rate (dB/m)": 0.382, "mountains' height (m)": 105.0, "UAVs' flight height (m)": 60.0}
    assert list(dict.fromkeys(row["quantity"] for row in rows)) == list(SWEEPS)
    for quantity, (*_, values) in SWEEPS.items():
        ours = {row["value"]: row for row in rows if row["quantity"] == quantity}
        numbers = [value[0] if isinstance(value, tuple) else value for value in values]
        assert list(ours) == sorted([*numbers, own[quantity]])
        base = ours[own[quantity]]
        assert base["difference"] == base["difference_low"] == base["difference_high"] == 0
        assert base["twcr"] == pytest.approx(np.mean([record["twcr"] for record in results["raycast"]]))
        for value in numbers:
            records = results[f"{quantity} {value:g}"]
            gap = np.mean([one["twcr"] - other["twcr"] for one, other in zip(records, results["raycast"])])
            assert ours[value]["difference"] == pytest.approx(gap) and ours[value]["missions"] == 5
            delivered, ended = (sum(record[f"telemetry_{what}"] for record in records) for what in ("delivered", "ended"))
            assert ours[value]["telemetry_delivered"] == pytest.approx(delivered / ended)
            assert ours[value]["peer_age"] == pytest.approx(np.mean([record["peer_age_mean"] for record in records]))


def test_shorter_sweeps_are_paired_with_the_first_missions(results, conditions):
    short = {label: records[:2] if "height" in label or "rate" in label else records for label, records in results.items()}
    for row in tables.sweep_rows(short, conditions, SCENARIOS["small"]):
        assert row["missions"] == 2
        if row["value"] == own_value(SCENARIOS["small"], row["quantity"]):
            assert row["twcr"] == pytest.approx(np.mean([record["twcr"] for record in results["raycast"][:2]]))


def test_the_policies_table(results):
    greedy, random = tables.transfer_rows(results, ["greedy", "random"])
    for row, prefix in ((greedy, ""), (random, "random ")):
        twcr = {model: np.array([record["twcr"] for record in results[prefix + model]]) for model in MODELS}
        for model, values in twcr.items():
            assert row[model] == pytest.approx(values.mean()) and row[f"{model}_low"] < row[model] < row[f"{model}_high"]
        gap = twcr["raycast"] - twcr["abstract"]
        assert (row["raycast_minus_abstract"], row["gap_low"], row["gap_high"]) == pytest.approx(tuple(mean_interval(gap)))
    assert (greedy["policy"], random["policy"]) == ("greedy", "random")


def ranked(abstract, raycast, spread=0.0):
    """Results of four policies with these mean TWCR under the two models."""
    rng, results = np.random.default_rng(0), {}
    for model, levels in (("abstract", abstract), ("raycast", raycast)):
        for policy, level in zip("abcd", levels):
            label = model if policy == "a" else f"{policy} {model}"
            results[label] = [mission(seed, rng, level + spread * rng.normal()) for seed in range(20)]
    return results


@pytest.mark.parametrize(
    "abstract, raycast, tau",
    [
        ((0.1, 0.2, 0.3, 0.4), (0.2, 0.3, 0.5, 0.9), 1.0),
        ((0.1, 0.2, 0.3, 0.4), (0.9, 0.5, 0.3, 0.2), -1.0),
        ((0.1, 0.2, 0.3, 0.4), (0.2, 0.1, 0.5, 0.9), 4 / 6),  # one of six pairs swaps
        ((0.1, 0.2, 0.3, 0.4), (0.3, 0.2, 0.1, 0.4), 0.0),  # three do
    ],
)
def test_the_rankings_tau(monkeypatch, abstract, raycast, tau):
    monkeypatch.setattr(tables, "RESAMPLES", 100)
    found = tables.ranking(ranked(abstract, raycast), list("abcd"))
    assert found["tau"] == pytest.approx(tau) and found["policies"] == 4
    assert (found["low"], found["high"]) == pytest.approx((tau, tau)), "nothing to resample"


def test_uncertain_rankings_have_wide_intervals(monkeypatch):
    monkeypatch.setattr(tables, "RESAMPLES", 300)
    found = tables.ranking(ranked((0.3, 0.301, 0.302, 0.6), (0.3, 0.301, 0.302, 0.6), spread=0.1), list("abcd"))
    assert found["low"] <= found["tau"] <= found["high"] and found["high"] - found["low"] > 0.3
    assert tables.ranking(ranked((0.1,) * 4, (0.2,) * 4), ["a"]) is None


@pytest.mark.parametrize("differing", [0, 2])
def test_the_controls(results, differing):
    rng = np.random.default_rng(1)
    digests = ["other" if i < differing else "same" for i in range(5)]
    free = {
        "obstacle-free abstract": [mission(i, rng) for i in range(5)],
        "obstacle-free raycast": [mission(i, rng, digest=digest) for i, digest in enumerate(digests)],
    }  # fmt: skip
    identical, twcr, ages = tables.control_rows(results | free)
    assert identical["value"] == f"{5 - differing} of 5" and "identical" in identical["control"]
    for row, name in ((twcr, "twcr"), (ages, "peer_age_mean")):
        gap = np.mean([one[name] - other[name] for one, other in zip(results[SHUFFLED], results["raycast"])])
        assert row["value"].startswith(f"{gap:.3f} [")


def test_csv_files_parse_as_written(tmp_path):
    rows = [{"a": 1, "b": "x, \"y\"\nz"}, {"a": 0.1, "b": "ü"}]
    tables.write_csv(tmp_path / "t.csv", rows)
    with open(tmp_path / "t.csv", newline="", encoding="utf-8") as file:
        assert list(csv.DictReader(file)) == [{"a": "1", "b": "x, \"y\"\nz"}, {"a": "0.1", "b": "ü"}]
    assert [path.name for path in tmp_path.iterdir()] == ["t.csv"]


def test_a_table_without_rows_is_written(tmp_path):
    tables.write_csv(tmp_path / "t.csv", [])


def test_a_kind_that_one_model_never_sent(results):
    """Rare kinds are sent under some link models and not under others."""
    silent = [{**record, "request_ended": 0, "request_delivered": 0} for record in results["raycast"]]
    rows = tables.message_rows({"abstract": results["abstract"], "raycast": silent}, ["abstract", "raycast"])
    shown = report._table(report._side_by_side(rows, "kind", ("delivered", "low", "high")))
    assert shown.count("<tr>") == 1 + len(KINDS) - 1 and "request" in shown


@pytest.mark.parametrize(
    "planar, cast, said",
    [
        (0.9, 0.8, "too optimistic by 10.0% of the messages"),
        (0.5, 0.75, "too pessimistic by 25.0% of the messages"),
        (0.8, 0.805, "right on average"),
    ],
)
def test_delivery_in_words(planar, cast, said):
    sentence = _delivery("UAV-UGV", {"delivered_abstract": planar, "delivered_raycast": cast})
    assert sentence.startswith("UAV-UGV links in range") and sentence.endswith(f"; it is {said}.")
    assert f"{planar:.1%}" in sentence and f"{cast:.1%}" in sentence


@pytest.mark.parametrize("low, high, undecided", [(-0.2, -0.1, False), (-0.2, 0.1, True), (0.0, 0.3, True), (0.1, 0.3, False)])
def test_changes_in_words(low, high, undecided):
    middle = (low + high) / 2
    row = {"mean": 0.6 + middle, "difference": middle, "difference_low": low, "difference_high": high, "condition": "raycast"}
    said = _change("TWCR", row, "", 3)
    assert said.startswith("TWCR: 0.600 under abstract links") and f"{middle:+.3f} [{low:+.3f}, {high:+.3f}]" in said
    assert ("holds 0" in said) == undecided and "raycast" in said


def test_every_class_and_control_has_its_sentence(results):
    foretold = {"brier": 0.1, "brier_fit": 0.05, "auc": 0.7, "auc_fit": 0.8}
    links = [
        {"links": name, "delivered_abstract": 0.9, "delivered_raycast": 0.5, **foretold}
        for name in ("UAV-UAV", "robot-robot", "all")
    ]
    found = {"links": links, "metrics": tables.metric_rows(results, MAIN), "controls": [{"control": "c", "value": "5 of 5"}]}
    said = sentences(found)
    assert sum(sentence.startswith("UAV-UAV links") for sentence in said) == 1 and "Control: c: 5 of 5." in said
    assert any("Brier score from 0.100 to 0.050 and the AUC from 0.700 to 0.800" in sentence for sentence in said)
    assert sentences(found | {"links": [links[0]]}), "no robot-robot links: a single robot"
