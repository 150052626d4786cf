"""What the comparison's numbers say, in sentences made from them: an interval that holds 0 decides nothing."""


def sentences(found: dict) -> list[str]:
    """The report's findings, from its tables."""
    links = {row["links"]: row for row in found["links"]}
    metrics = {(row["condition"], row["metric"]): row for row in found["metrics"]}
    said = [_delivery(name, row) for name, row in links.items() if name != "all"]
    said += [
        _change("TWCR", metrics["raycast", "twcr"], "", 3),
        _change("The age of peers' reports", metrics["raycast", "peer_age_mean"], " s", 1),
        _change("The age of the station's reports", metrics["raycast", "station_age_mean"], " s", 1),
        _change("Refitted decay lengths: TWCR", metrics["abstract-fit", "twcr"], "", 3),
    ]
    said += [_foresight("robot-robot links", links["robot-robot"])] if "robot-robot" in links else []
    return said + [f"Control: {row['control']}: {row['value']}." for row in found["controls"]]


def _delivery(name, row):
    planar, cast = row["delivered_abstract"], row["delivered_raycast"]
    verdict = "right on average"
    if abs(planar - cast) >= 0.01:
        verdict = f"too {'optimistic' if planar > cast else 'pessimistic'} by {abs(planar - cast):.1%} of the messages"
    return f"{name} links in range: the abstract model delivers {planar:.1%}, ray casts {cast:.1%}; it is {verdict}."


def _change(what, row, unit, digits):
    mean, low, high = (f"{row[name]:+.{digits}f}" for name in ("difference", "difference_low", "difference_high"))
    undecided = "; the interval holds 0" if row["difference_low"] <= 0 <= row["difference_high"] else ""
    base = f"{row['mean'] - row['difference']:.{digits}f}{unit} under abstract links"
    return f"{what}: {base}, {mean}{unit} [{low}, {high}] under {row['condition']} ones{undecided}."


def _foresight(what, row):
    brier, auc = (f"from {row[name]:.3f} to {row[f'{name}_fit']:.3f}" for name in ("brier", "auc"))
    return f"Foretelling fates of {what}: refitting changes the Brier score {brier} and the AUC {auc}; the rest is structure."
