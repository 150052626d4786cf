"""The abstract model's links held against the ray-cast ones."""

import numpy as np
from scipy.stats import rankdata

from ...planning.link_pairs import CLASSES, STATION

HOPELESS = 40.0  # dB: a link in range that loses more is lost at any distance, so that excess losses count up to here
N_BINS = 10  # of a reliability diagram
BLOCKAGE = np.dtype([("kind", "i1"), ("is_planar", "?"), ("seconds", "i4")])


def is_clear(links, model: str) -> np.ndarray:
    """Whether nothing stands between: no footprint in plan, or no canopy and no mountain in the ray."""
    if model == "abstract":
        return (links["planar_forest"] == 0) & (links["planar_mountain"] == 0)
    return (links["ray_forest"] == 0) & ~links["ray_blocked"]


def implied_loss(passing, margin: float) -> np.ndarray:
    """The excess loss [dB] that an abstract share stands for: as much margin as each halving uses up at the range."""
    with np.errstate(divide="ignore"):
        return np.minimum(HOPELESS, -margin * np.log2(passing))


def link_rows(links, margin: float) -> list[dict]:
    """One row a class of links, for those between robots, and for all: shares, sight, excess loss, fates foretold.

    Args:
      links: [n] PAIR, in range.
      margin: radio.margin [dB].
    """
    rng = np.random.default_rng(0)
    fates = rng.random(len(links)) < links["ray_delivered"]
    rows = []
    for name, chosen in _classes(links):
        ours, heard = links[chosen], fates[chosen]
        if not len(ours):
            continue
        flat, cast = is_clear(ours, "abstract"), is_clear(ours, "raycast")
        error = implied_loss(ours["planar_passing"], margin) - np.minimum(HOPELESS, ours["ray_excess"])
        rows.append({
            "links": name,
            "samples": len(ours),
            "delivered_abstract": float(ours["planar_delivered"].mean()),
            "delivered_abstract_fit": float(ours["fit_delivered"].mean()),
            "delivered_raycast": float(ours["ray_delivered"].mean()),
            "both_clear": float(np.mean(flat & cast)),
            "only_abstract_clear": float(np.mean(flat & ~cast)),
            "only_raycast_clear": float(np.mean(~flat & cast)),
            "both_obstructed": float(np.mean(~flat & ~cast)),
            "excess_bias_db": float(error.mean()),
            "excess_rmse_db": float(np.sqrt(np.mean(error**2))),
            "excess_p90_db": float(np.percentile(np.abs(error), 90)),
            **foresight(ours["planar_delivered"], heard, ""),
            **foresight(ours["fit_delivered"], heard, "_fit"),
        })  # fmt: skip
    return rows


def _classes(links):
    yield from ((name, links["kind"] == k) for k, name in enumerate(CLASSES))
    yield "robot-robot", links["kind"] != STATION
    yield "all", np.ones(len(links), bool)


def foresight(foretold, heard, suffix) -> dict:
    """How well delivery probabilities tell fates."""
    return {
        f"brier{suffix}": float(np.mean((foretold - heard) ** 2)),
        f"ece{suffix}": calibration_error(foretold, heard),
        f"auc{suffix}": area_under_roc(foretold, heard),
    }


def reliability(foretold, heard) -> list[tuple[float, float, int]]:
    """(mean foretold, share heard, links) of every bin of the foretold probability that holds links."""
    index = np.minimum((foretold * N_BINS).astype(int), N_BINS - 1)
    bins = []
    for i in range(N_BINS):
        ours = index == i
        if ours.any():
            bins.append((float(foretold[ours].mean()), float(heard[ours].mean()), int(ours.sum())))
    return bins


def calibration_error(foretold, heard) -> float:
    """Expected calibration error over equal bins."""
    return sum(n * abs(mean - share) for mean, share, n in reliability(foretold, heard)) / len(heard)


def area_under_roc(foretold, heard) -> float:
    """Probability that a link that delivered was foretold better than one that did not (Mann-Whitney); nan without both."""
    if heard.all() or not heard.any():
        return float("nan")
    n = heard.sum()
    return float((rankdata(foretold)[heard].mean() - (n + 1) / 2) / (len(heard) - n))


def blockages(links) -> np.ndarray:
    """[m] BLOCKAGE: how long links in range stay obstructed without a break, under each model.

    Args:
      links: [n] PAIR of one mission, second by second.
    """
    links = links[np.lexsort((links["time"], links["b"], links["a"]))]
    found = []
    for model in ("abstract", "raycast"):
        obstructed = ~is_clear(links, model)
        broken = (np.diff(links["a"]) != 0) | (np.diff(links["b"]) != 0) | (np.diff(links["time"]) != 1)
        starts = np.flatnonzero(np.r_[True, broken | (np.diff(obstructed) != 0)])[: len(links)]
        seconds, first = np.diff(np.r_[starts, len(links)]), obstructed[starts]
        rows = np.zeros(int(first.sum()), BLOCKAGE)
        rows["kind"], rows["is_planar"], rows["seconds"] = links["kind"][starts[first]], model == "abstract", seconds[first]
        found.append(rows)
    return np.concatenate(found)


def blockage_rows(found) -> list[dict]:
    """Episodes and their lengths [s] by class and model."""
    rows = []
    for k, name in enumerate(CLASSES):
        for model in ("abstract", "raycast"):
            seconds = found["seconds"][(found["kind"] == k) & (found["is_planar"] == (model == "abstract"))]
            if len(seconds):
                rows.append({
                    "links": name, "model": model, "episodes": len(seconds), "mean_s": float(seconds.mean()),
                    "median_s": float(np.median(seconds)), "p90_s": float(np.percentile(seconds, 90)),
                })  # fmt: skip
    return rows
