"""The comparison's tables: a list of rows each, written as CSV and shown in the report."""

import csv

import numpy as np
from scipy.stats import kendalltau

from ...base.files import whole_file
from ...base.terms import Kind
from ...flights.statistics import mean_interval
from .message_counts import LONGEST, ROUTES
from .plan import FREE, MODELS, SHUFFLED, own_value

METRICS = {  # of a mission record: what the report calls it
    "twcr": "TWCR",
    "completion": "tasks completed",
    "on_time": "tasks completed on time",
    "control_time": "operators' control time",
    "refusals": "claims refused",
    "broadcast_rate": "broadcasts (1/robot-min)",
    "query_rate": "queries (1/robot-min)",
    "peer_age_mean": "age of peers' reports, mean (s)",
    "peer_age_p95": "age of peers' reports, P95 (s)",
    "peer_age_peak": "age of peers' reports, peak (s)",
    "station_age_mean": "age of station's reports, mean (s)",
    "station_age_p95": "age of station's reports, P95 (s)",
    "station_age_peak": "age of station's reports, peak (s)",
    "components_mean": "connected components of the robots",
    "connected_share": "time that all robots are connected",
    "station_reach": "robots that reach the station",
}
RESAMPLES = 2000  # of missions, for the ranking's interval


def column(records: list[dict], name: str) -> np.ndarray:
    """[missions] one number of every record."""
    return np.array([record[name] for record in records], float)


def mission_rows(results: dict) -> list[dict]:
    """One row a mission and condition."""
    names = ["seed", *METRICS, "fatigue", "malfunctions", "duration", "bytes_sent", "digest"]
    return [
        {"condition": label} | {name: record[name] for name in names} for label, records in results.items() for record in records
    ]


def metric_rows(results: dict, labels, baseline="abstract") -> list[dict]:
    """Means with 95 % intervals, and paired differences to a baseline on the same missions."""
    rows = []
    for label in labels:
        for name, title in METRICS.items():
            values = column(results[label], name)
            paired = column(results[baseline], name)[: len(values)]
            mean, gap = mean_interval(values), mean_interval(values - paired)
            rows.append({
                "condition": label, "metric": name, "title": title, "mean": mean.mean, "low": mean.low, "high": mean.high,
                "difference": gap.mean, "difference_low": gap.low, "difference_high": gap.high,
            })  # fmt: skip
    return rows


def message_rows(results: dict, labels) -> list[dict]:
    """Delivery by kind, with 95 % intervals over missions; kinds that nobody sent are left out."""
    rows = []
    for label in labels:
        for kind in (kind.name.lower() for kind in Kind):
            ended, delivered = (column(results[label], f"{kind}_{what}") for what in ("ended", "delivered"))
            sent = ended > 0
            if sent.any():
                ratio = mean_interval(delivered[sent] / ended[sent])
                rows.append({
                    "condition": label, "kind": kind, "messages": ended.sum() / len(ended),
                    "delivered": ratio.mean, "low": ratio.low, "high": ratio.high,
                })  # fmt: skip
    return rows


def latency_curves(records: list[dict], route: str) -> np.ndarray:
    """[LONGEST + 1] share of a route's messages delivered within 0, 1, … s; expired and lost ones never are."""
    counts = np.sum([record["latency"][route]["delivered_after"] for record in records], axis=0)
    ended = sum(record["latency"][route]["ended"] for record in records)
    return np.cumsum(counts) / max(1, ended)


def latency_rows(results: dict, labels) -> list[dict]:
    """Shares of messages delivered within some seconds, and expired, by route."""
    rows = []
    for label in labels:
        for route in ROUTES:
            curve = latency_curves(results[label], route)
            each = [record["latency"][route] for record in results[label]]
            ended = max(1, sum(one["ended"] for one in each))
            rows.append({
                "condition": label, "route": route, **{f"within_{t}_s": curve[t] for t in (1, 2, 5, 10, 30, LONGEST)},
                "expired": sum(one["expired"] for one in each) / ended,
            })  # fmt: skip
    return rows


def sweep_rows(results: dict, conditions, scenario) -> list[dict]:
    """Along every sweep, under ray-cast links: TWCR, ages, delivery, and paired TWCR differences to the scenario's own value."""
    rows = []
    for quantity in dict.fromkeys(condition.sweep for condition in conditions if condition.sweep):
        ours = {condition.value: condition.label for condition in conditions if condition.sweep == quantity}
        base = results["raycast"][: len(results[next(iter(ours.values()))])]
        swept = {own_value(scenario, quantity): base} | {value: results[label] for value, label in ours.items()}
        for value, records in sorted(swept.items()):
            gap = mean_interval(column(records, "twcr") - column(base, "twcr"))
            telemetry = column(records, "telemetry_delivered").sum() / max(1, column(records, "telemetry_ended").sum())
            rows.append({
                "quantity": quantity, "value": value, "missions": len(records), "twcr": column(records, "twcr").mean(),
                "difference": gap.mean, "difference_low": gap.low, "difference_high": gap.high,
                "peer_age": column(records, "peer_age_mean").mean(), "station_age": column(records, "station_age_mean").mean(),
                "telemetry_delivered": telemetry,
            })  # fmt: skip
    return rows


def transfer_rows(results: dict, policies) -> list[dict]:
    """Every policy's TWCR under every link model: the columns of the train-under x test-under grid."""
    rows = []
    for policy in policies:
        row = {"policy": policy}
        twcr = {model: column(results[_label(policies, policy, model)], "twcr") for model in MODELS}
        for model, values in twcr.items():
            row |= dict(zip((model, f"{model}_low", f"{model}_high"), mean_interval(values)))
        gap = mean_interval(twcr["raycast"] - twcr["abstract"])
        rows.append(row | {"raycast_minus_abstract": gap.mean, "gap_low": gap.low, "gap_high": gap.high})
    return rows


def _label(policies, policy, model):
    return model if policy == policies[0] else f"{policy} {model}"


def ranking(results: dict, policies) -> dict | None:
    """Kendall's tau between the policies' rankings under abstract and ray-cast links; None for a single policy."""
    if len(policies) < 2:
        return None
    tables = [
        np.stack([column(results[_label(policies, p, model)], "twcr") for p in policies]) for model in ("abstract", "raycast")
    ]
    tau = float(kendalltau(*(table.mean(axis=1) for table in tables)).statistic)
    rng, n = np.random.default_rng(0), tables[0].shape[1]
    draws = rng.integers(n, size=(RESAMPLES, n))
    taus = [kendalltau(*(table[:, draw].mean(axis=1) for table in tables)).statistic for draw in draws]
    low, high = np.nanpercentile(taus, [2.5, 97.5])
    return {"policies": len(policies), "tau": tau, "low": float(low), "high": float(high)}


def control_rows(results: dict) -> list[dict]:
    """The two controls: identical missions without obstacles, and what is left when links lose their geometry."""
    pairs = list(zip(results[FREE + "abstract"], results[FREE + "raycast"]))
    same = sum(one["digest"] == other["digest"] for one, other in pairs)
    gap = mean_interval(column(results[SHUFFLED], "twcr") - column(results["raycast"], "twcr"))
    ages = mean_interval(column(results[SHUFFLED], "peer_age_mean") - column(results["raycast"], "peer_age_mean"))
    return [
        {"control": "obstacle-free: missions bit-identical under both models", "value": f"{same} of {len(pairs)}"},
        {"control": "shuffled identities: TWCR, difference to ray cast", "value": str(gap)},
        {"control": "shuffled identities: age of peers' reports (s), difference to ray cast", "value": str(ages)},
    ]


def write_csv(path, rows: list[dict]) -> None:
    """Write rows that share their columns; without rows, an empty file."""
    with whole_file(path) as part, open(part, "w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]) if rows else [])
        writer.writeheader()
        writer.writerows(rows)
