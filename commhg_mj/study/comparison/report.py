"""The comparison's report: one HTML file with everything inside, to be sent to a colleague."""

import base64
from datetime import date
from html import escape
from pathlib import Path

from ...base.files import whole_file
from ...base.version import __version__
from ...flights.statistics import Interval
from .findings import sentences

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1b1f24; max-width: 1080px; margin: 2em auto; padding: 0 1.2em; }
h1 { font-size: 1.7em; } h2 { font-size: 1.25em; margin-top: 2.2em; border-bottom: 1px solid #d8dee4; }
table { border-collapse: collapse; font-size: 13px; margin: 1em 0; display: block; overflow-x: auto; }
th, td { padding: 3px 9px; text-align: right; border-bottom: 1px solid #e6eaee; } th { background: #f6f8fa; }
td:first-child, th:first-child, td.text { text-align: left; }
figure { margin: 1.2em 0; } img, video { max-width: 100%; } figcaption { color: #57606a; font-size: 13px; }
"""
SECTIONS = (  # title, what it says, tables, figures with captions
    (
        "Links",
        "Every pair of radios in range, every five seconds of some missions flown under ray-cast links. A link is clear when "
        "nothing stands between: no footprint in plan (abstract), no canopy and no mountain in the ray (ray cast). The excess "
        "loss of an abstract link is the margin that its share of delivered packets stands for: one margin for each halving. "
        "Brier score, calibration error (ECE) and the area under the ROC curve (AUC) hold the foretold delivery probability "
        "against drawn ray-cast fates; _fit is the abstract model with fitted decay lengths.",
        ("sight", "foresight", "blockages"),
        (
            ("coverage_station", "Where telemetry reaches the station."),
            ("coverage_middle", "Where a broadcast from the middle of the map is heard."),
            ("delivery", "Distribution of delivery probabilities."),
            ("reliability", "Reliability diagram; the size of a mark is its share of the class's links."),
            ("blockages", "How long obstructed links stay so."),
        ),
    ),
    (
        "Messages",
        "All messages of all missions. Ages count a robot that nothing was heard of as old as the mission; a link connects two "
        "robots when it delivers at least one half.",
        ("delivery", "latency"),
        (
            ("latency", "Latency since a message was queued; what expires or is lost never arrives."),
            ("ages", "Age of information and connectivity."),
        ),
    ),
    (
        "Missions",
        "The same missions under every model, hence paired differences (95 % bootstrap intervals over missions). A policy that "
        "was trained under a link model is a row of the policies' table: its columns are the models that it was tested under.",
        ("values", "differences", "policies", "ranking"),
        (("missions", "TWCR of the same missions under both models, and differences to the abstract one."),),
    ),
    (
        "Sweeps",
        "Ray-cast links with one quantity changed; differences to the scenario's own value are paired, on the same missions.",
        ("sweeps",),
        (("sweeps", "TWCR along the sweeps."),),
    ),
    (
        "Controls",
        "In the matched profile without shadowing both models must give the same missions, bit by bit, where there are no "
        "obstacles. With shuffled identities every robot has another robot's ray-cast links: the same losses on average, "
        "without their geometry.",
        ("controls",),
        (),
    ),
)
SIGHT = ("samples", "delivered_abstract", "delivered_abstract_fit", "delivered_raycast", "both_clear", "only_abstract_clear",
         "only_raycast_clear", "both_obstructed")  # fmt: skip
FORESIGHT = ("excess_bias_db", "excess_rmse_db", "excess_p90_db", "brier", "ece", "auc", "brier_fit", "ece_fit", "auc_fit")


def write_report(folder: Path, facts: dict, found: dict, drawn: dict, clip: Path | None) -> Path:
    """Write report.html.

    Args:
      facts: how the comparison was made.
      found: tables, lists of rows by name.
      drawn: paths of figures by name.
      clip: a video, or None.
    """
    path, shown = folder / "report.html", found | _arranged(found)
    parts = [f"<h1>Abstract and ray-cast links: {escape(facts['scenario'])}</h1>"]
    parts += ["<ul>", *(f"<li>{escape(sentence)}</li>" for sentence in sentences(found)), "</ul>"]
    if clip:
        parts.append(_figure(_embed(clip, "video/mp4", "video"), f"Mission {clip.stem.split('-')[-1]}, the one of the looked-at "
                             "missions whose TWCR differs most: abstract left, ray cast right."))  # fmt: skip
    for title, text, names, pictures in SECTIONS:
        parts += [f"<h2>{title}</h2>", f"<p>{escape(text)}</p>"]
        parts += [_table(shown[name]) for name in names if shown.get(name)]
        parts += [_figure(_embed(drawn[name], "image/png", "img"), caption) for name, caption in pictures]
    parts += ["<h2>How this was made</h2>", _facts(facts)]
    with whole_file(path) as part:
        part.write_text(
            '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
            f"<title>commhg_mj comparison: {escape(facts['scenario'])}</title><style>{STYLE}</style></head>\n"
            f"<body>{chr(10).join(parts)}</body></html>\n"
        )
    return path


def _arranged(found):
    """Tables as a reader wants them: what the CSV files hold row by row, side by side."""
    columns = {"sight": SIGHT, "foresight": FORESIGHT}
    arranged = {name: [{key: row[key] for key in ("links", *keys)} for row in found["links"]] for name, keys in columns.items()}
    arranged["delivery"] = _side_by_side(found["messages"], "kind", ("delivered", "low", "high"))
    arranged["values"] = _side_by_side(found["metrics"], "title", ("mean", "low", "high"))
    differing = [row for row in found["metrics"] if row["condition"] != "abstract"]
    columns = "difference", "difference_low", "difference_high"
    arranged["differences"] = [
        {"difference to abstract": row.pop("title")} | row for row in _side_by_side(differing, "title", columns)
    ]
    return arranged


def _side_by_side(rows, key, interval):
    """One row a key, one column a condition: `value [low, high]`."""
    table, empty = {}, dict.fromkeys((row["condition"] for row in rows), "")
    for row in rows:
        table.setdefault(row[key], {key: row[key]} | empty)[row["condition"]] = str(Interval(*(row[name] for name in interval)))
    return list(table.values())


def _facts(facts):
    rows = facts | {
        "software": f"commhg_mj {__version__}",
        "date": date.today().isoformat(),
        "tables": "CSV files beside this one",
    }
    cells = (f'<tr><td>{escape(name)}</td><td class="text">{escape(str(value))}</td></tr>' for name, value in rows.items())
    return f"<table>{''.join(cells)}</table>"


def _table(rows):
    names = list(rows[0])
    head = "".join(f"<th>{escape(name.replace('_', ' '))}</th>" for name in names)
    body = "".join("<tr>" + "".join(f"<td>{_cell(row[name])}</td>" for name in names) + "</tr>" for row in rows)
    return f"<table><tr>{head}</tr>{body}</table>"


def _cell(value):
    if isinstance(value, float):
        return f"{value:.3f}" if abs(value) < 100 else f"{value:,.0f}"
    return f"{value:,}" if isinstance(value, int) and not isinstance(value, bool) else escape(str(value))


def _embed(path, kind, tag):
    data = f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode()}"
    return f'<img alt="{path.stem}" src="{data}">' if tag == "img" else f'<video controls loop muted src="{data}"></video>'


def _figure(content, caption):
    return f"<figure>{content}<figcaption>{escape(caption)}</figcaption></figure>"
