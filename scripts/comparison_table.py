"""Write the figures of comparisons into docs/radio.md.

commhg-mj compare --scenario small --missions 200 --out runs/small     and medium, large
python scripts/comparison_table.py runs/small runs/medium runs/large   a column a folder
"""

import csv
import json
import sys
from pathlib import Path

from architecture import ROOT, redraw

PAGE = ROOT / "docs" / "radio.md"
BEGIN = "<!-- made by scripts/comparison_table.py -->"
PAIRS = ("UAV-UAV", "UAV-UGV", "UGV-UGV", "robot-station")
DIFFERENCES = {  # of metrics under ray casts: unit, digits
    "station_age_mean": ("age of the station's reports (s)", 1),
    "peer_age_mean": ("age of peers' reports (s)", 1),
    "control_time": ("operators' control time", 3),
    "components_mean": ("connected components", 2),
}


def read(folder, name, *keys) -> dict:
    """{key: row} of a table of a comparison."""
    with open(Path(folder, f"{name}.csv"), newline="") as file:
        return {tuple(row[key] for key in keys): row for row in csv.DictReader(file)}


def column(folder) -> dict[str, str]:
    """{what: figure} of one comparison."""
    links, metrics = read(folder, "links", "links"), read(folder, "metrics", "condition", "metric")
    controls = {words: row["value"] for (words,), row in read(folder, "controls", "control").items()}
    rounded = lambda row, digits, *names: [f"{float(row[name]):.{digits}f}" for name in names]
    said = {}
    for pair in PAIRS:
        figures = rounded(links[(pair,)], 3, "delivered_abstract", "delivered_raycast")
        said[f"delivered, {pair} links in range: abstract, ray cast"] = ", ".join(figures)
    for words, name in (("Brier score of robot-robot fates", "brier"), ("AUC of the same", "auc")):
        said[f"{words}: abstract, fitted"] = ", ".join(rounded(links[("robot-robot",)], 3, name, f"{name}_fit"))
    said |= of_policies(folder)
    said["TWCR, fitted, difference"] = difference(metrics["abstract-fit", "twcr"], 3)
    for name, (words, digits) in DIFFERENCES.items():
        said[f"{words}, difference"] = difference(metrics["raycast", name], digits)
    shuffled = next(value for words, value in controls.items() if words.startswith("shuffled identities: TWCR"))
    identical = next(value for words, value in controls.items() if words.startswith("obstacle-free"))
    said["shuffled identities, TWCR, difference to ray cast"] = shuffled
    return said | {"obstacle-free missions bit-identical": identical}


def of_policies(folder) -> dict[str, str]:
    """What ray casts change for each policy; all other rows are of the first one."""
    gap = "raycast_minus_abstract", "gap_low", "gap_high"
    return {
        f"TWCR of `{name}`, abstract; ray cast, difference": f"{float(row['abstract']):.3f}; {difference(row, 3, gap)}"
        for (name,), row in read(folder, "policies", "policy").items()
    }


def difference(row, digits, names=("difference", "difference_low", "difference_high")) -> str:
    """Paired, with its interval."""
    mean, low, high = (f"{float(row[name]):+.{digits}f}" for name in names)
    return f"{mean} [{low}, {high}]"


def table(folders) -> str:
    """A column a comparison, under its scenario's name."""
    names = [json.loads(Path(folder, "comparison.json").read_text())["scenario"]["name"] for folder in folders]
    columns = [column(folder) for folder in folders]
    rows = list(dict.fromkeys(what for each in columns for what in each))
    lines = [["", *names], ["---"] * (1 + len(names)), *([what, *(each.get(what, "") for each in columns)] for what in rows)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


if __name__ == "__main__":
    sys.exit(redraw(PAGE, BEGIN, table(sys.argv[1:])))
