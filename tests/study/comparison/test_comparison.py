"""A whole comparison, once: its files, its numbers against flights of our own, and its report."""

import base64
import csv
import html
import json
import re
from collections import Counter
from html.parser import HTMLParser
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from strategies import change

from commhg_mj.base import charts
from commhg_mj.base.terms import Fate, Kind
from commhg_mj.flights import fly as flying
from commhg_mj.flights.fly import fly, fly_to_end
from commhg_mj.flights.statistics import Interval
from commhg_mj.mission.trace import make_traces
from commhg_mj.planning import coverage
from commhg_mj.planning.link_pairs import CLASSES, PAIR, links_of
from commhg_mj.scenarios import load_scenario
from commhg_mj.study.comparison import clip, compare, count_flights, figures
from commhg_mj.study.comparison import record_tables as tables
from commhg_mj.study.comparison.message_counts import ROUTES
from commhg_mj.study.comparison.plan import SWEEPS
from commhg_mj.study.comparison.sight import BLOCKAGE

TOML = """
base = "small"
name = "tiny"
n_tasks = 5
time_limit = 70
[world]
forest_share = 0.3
n_forests = 8
uav_height = 15.0
[robots]
autonomous_speed = [18.0, 10.0]
[communication]
range = [0.2, 0.15, 0.1]
"""
SEEDS = range(30_000, 30_003)
LINK_MODELS = ("abstract", "abstract-fit", "raycast", "raycast-shuffled")
CSV = ["blockages", "controls", "latency", "links", "messages", "metrics", "missions", "policies", "ranking", "sweeps"]
PNG = ["ages", "blockages", "coverage_middle", "coverage_station", "delivery", "latency", "missions", "reliability", "sweeps"]


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenario") / "tiny.toml"
    path.write_text(TOML)
    return load_scenario(path)


@pytest.fixture(scope="module")
def made(scenario, tmp_path_factory):
    """The folder of a comparison, its report's path, and what it told of its progress; small pictures for speed."""
    folder, told = tmp_path_factory.mktemp("comparison") / "deep" / "er", []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(charts, "DPI", 40)
        patch.setattr(coverage, "CELLS", 50)
        patch.setattr(tables, "RESAMPLES", 100)
        patch.setattr(flying, "CHUNK", 2)
        report = compare(scenario, ["greedy", "random", "greedy"], 3, folder, with_clip=False, advance=told.append)
    return SimpleNamespace(folder=folder, report=report, told=told)


@pytest.fixture(scope="module")
def found(made):
    """{name: rows} of the CSV files."""
    rows = {}
    for name in CSV:
        with open(made.folder / f"{name}.csv", newline="") as file:
            rows[name] = list(csv.DictReader(file))
    return rows


@pytest.fixture(scope="module")
def traces(scenario):
    """{link model: traces} of the first policy's missions, flown here."""
    return {
        links: make_traces(fly_to_end("greedy", scenario, SEEDS, links, record=True), "greedy") for links in LINK_MODELS
    }  # fmt: skip


def row_of(rows, **where):
    (row,) = (row for row in rows if all(row[name] == value for name, value in where.items()))
    return row


def test_every_file_is_there(made):
    assert made.report == made.folder / "report.html"
    expected = {*(f"{name}.csv" for name in CSV), *(f"{name}.png" for name in PNG), "report.html", "comparison.json", "parts"}
    assert {path.name for path in made.folder.iterdir()} == expected
    for name in PNG:
        picture = cv2.imread(str(made.folder / f"{name}.png"))
        assert picture is not None and picture.std() > 5, name


def test_progress_counts_every_flight(made, scenario):
    assert sum(made.told) == count_flights(scenario, ["greedy", "random"], 3) == 18 * 3 + 3


def test_tables_parse_and_are_rectangular(made):
    for name in CSV:
        with open(made.folder / f"{name}.csv", newline="") as file:
            head, *rows = csv.reader(file)
        assert rows and len(set(head)) == len(head) and {len(row) for row in rows} == {len(head)}, name


def test_missions_are_those_that_fly_flies(scenario, found, traces):
    """Scores of every main condition, mission by mission."""
    for links in LINK_MODELS:
        scores = fly(scenario, "greedy", SEEDS, links)
        ours = [row for row in found["missions"] if row["condition"] == links]
        assert [int(row["seed"]) for row in ours] == list(SEEDS)
        for row, score, trace in zip(ours, scores, traces[links]):
            for name in ("twcr", "completion", "on_time", "control_time", "fatigue", "bytes_sent", "duration"):
                assert float(row[name]) == getattr(score, name)
            assert float(row["twcr"]) == pytest.approx(trace.twcr())
        metrics = row_of(found["metrics"], condition=links, metric="twcr")
        assert float(metrics["mean"]) == pytest.approx(np.mean([score.twcr for score in scores]))


def test_the_links_change_something(found):
    digests = {row["condition"]: row["digest"] for row in found["missions"] if row["seed"] == "30000"}
    assert len({digests[links] for links in LINK_MODELS}) > 2


def test_without_obstacles_the_models_agree(found):
    assert row_of(found["controls"], control="obstacle-free: missions bit-identical under both models")["value"] == "3 of 3"
    free = [[row["digest"] for row in found["missions"] if row["condition"] == f"obstacle-free {m}"] for m in LINK_MODELS[::2]]
    assert free[0] == free[1] and len(set(free[0])) == 3


def test_the_policies_table_holds_every_policy(scenario, found):
    assert [row["policy"] for row in found["policies"]] == ["greedy", "random"]
    for row in found["policies"]:
        for links in LINK_MODELS[:3]:
            twcr = np.mean([score.twcr for score in fly(scenario, row["policy"], SEEDS, links)])
            assert float(row[links]) == pytest.approx(twcr)
        gap = float(row["raycast"]) - float(row["abstract"])
        assert float(row["raycast_minus_abstract"]) == pytest.approx(gap, abs=1e-9)


def test_message_ratios_by_counting(found, traces):
    for links in LINK_MODELS:
        for kind in Kind:
            ratios, ended = [], 0
            for trace in traces[links]:
                fates = Counter(int(f) for k, f in zip(trace.message_kind, trace.message_fate) if k == kind)
                over = sum(fates.values()) - fates[Fate.UNDERWAY]
                ended += over
                if over:
                    ratios.append(fates[Fate.DELIVERED] / over)
            rows = [r for r in found["messages"] if (r["condition"], r["kind"]) == (links, kind.name.lower())]
            assert len(rows) == bool(ratios)
            for row in rows:
                assert float(row["delivered"]) == pytest.approx(np.mean(ratios))
                assert float(row["messages"]) == pytest.approx(ended / 3)


def test_latencies_by_counting(found, traces):
    for links in LINK_MODELS:
        for route, kinds in ROUTES.items():
            ended, waits = 0, []
            for trace in traces[links]:
                ours = np.isin(trace.message_kind, kinds) & (trace.message_fate != Fate.UNDERWAY)
                ended += ours.sum()
                arrived = ours & (trace.message_fate == Fate.DELIVERED)
                waits += list(trace.message_ended[arrived] - trace.message_queued[arrived])
            row = row_of(found["latency"], condition=links, route=route)
            shares = [float(row[f"within_{t}_s"]) for t in (1, 2, 5, 10, 30, 60)]
            assert shares == pytest.approx([np.sum(np.array(waits) <= t) / ended for t in (1, 2, 5, 10, 30, 60)])
            assert shares == sorted(shares) and shares[-1] == pytest.approx(len(waits) / ended)


def test_link_shares_from_traces(scenario, found, traces):
    rows = np.concatenate([links_of(trace) for trace in traces["raycast"]])
    rows = rows[rows["in_range"] & (rows["time"] % 5 == 0)]
    for k, name in enumerate(CLASSES):
        ours = rows[rows["kind"] == k]
        row = row_of(found["links"], links=name)
        assert int(row["samples"]) == len(ours) > 0
        assert float(row["delivered_abstract"]) == pytest.approx(ours["planar_delivered"].mean(), abs=1e-6)
        assert float(row["delivered_raycast"]) == pytest.approx(ours["ray_delivered"].mean(), abs=1e-6)
        shares = [float(row[s]) for s in ("both_clear", "only_abstract_clear", "only_raycast_clear", "both_obstructed")]
        assert sum(shares) == pytest.approx(1)
    assert float(row_of(found["links"], links="all")["samples"]) == len(rows)


def test_sweeps_hold_the_own_value(scenario, found):
    for quantity, own in (("foliage rate (dB/m)", 0.382), ("mountains' height (m)", 105.0), ("UAVs' flight height (m)", 15.0)):
        ours = [row for row in found["sweeps"] if row["quantity"] == quantity]
        values = [float(row["value"]) for row in ours]
        assert values == sorted(values) and own in values
        row = ours[values.index(own)]
        assert float(row["difference"]) == 0
        raycast = row_of(found["metrics"], condition="raycast", metric="twcr")
        assert float(row["twcr"]) == pytest.approx(float(raycast["mean"]))
    higher = change(scenario, uav_height=120.0)
    row = row_of(found["sweeps"], quantity="UAVs' flight height (m)", value="120.0")
    assert float(row["twcr"]) == pytest.approx(np.mean([score.twcr for score in fly(higher, "greedy", SEEDS, "raycast")]))


class Page(HTMLParser):
    """Tags, addresses and tables of a page, rows of cells."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.addresses, self.tables, self.in_cell = Counter(), [], [], False
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags[tag] += 1
        self.addresses += [value for name, value in attributes if name in ("src", "href", "poster", "data", "action")]
        if tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in ("td", "th"):
            self.tables[-1][-1].append("")
            self.in_cell = True

    def handle_endtag(self, tag):
        self.in_cell = self.in_cell and tag not in ("td", "th")

    def handle_data(self, data):
        if self.in_cell:
            self.tables[-1][-1][-1] += data


@pytest.fixture(scope="module")
def page(made):
    return Page(made.report.read_text())


def test_the_report_is_one_file(made, page):
    assert page.addresses and all(address.startswith("data:image/png;base64,") for address in page.addresses)
    text = made.report.read_text()
    assert not re.search(r"url\(|@import|<script|<link|<iframe|https?://", text)
    assert text.startswith("<!doctype html>") and text.endswith("</html>\n") and "</body>" in text


def test_the_report_holds_every_figure(made, page):
    shown = {base64.b64decode(address.partition(",")[2]) for address in page.addresses}
    assert shown == {(made.folder / f"{name}.png").read_bytes() for name in PNG}
    assert page.tags["figcaption"] == page.tags["img"] == len(PNG)


def test_the_report_holds_every_table(page, found):
    heads = [tuple(table[0]) for table in page.tables]
    cells = [{cell for row in table for cell in row} for table in page.tables]
    assert len(page.tables) == 2 + 1 + 2 + 4 + 1 + 1 + 1, "links, blockages, messages, missions, sweeps, controls, facts"
    assert all(len({len(row) for row in table}) == 1 for table in page.tables)
    for name, column in (
        ("links", "links"), ("blockages", "model"), ("latency", "route"), ("policies", "policy"), ("sweeps", "quantity"),
        ("controls", "value"), ("metrics", "title"), ("messages", "kind"),
    ):  # fmt: skip
        keys = {row[column] for row in found[name]}
        assert any(keys <= each for each in cells), name
    assert ("policies", "tau", "low", "high") in heads
    sight = next(table for table in page.tables if "both clear" in table[0])
    for line in sight[1:]:
        row = row_of(found["links"], links=line[0])
        for title, cell in zip(sight[0][1:], line[1:]):
            assert float(cell.replace(",", "")) == pytest.approx(float(row[title.replace(" ", "_")]), abs=5.1e-4)


def test_values_of_the_report_are_those_of_the_files(page, found):
    values = next(table for table in page.tables if table[0] == ["title", *LINK_MODELS])
    for title, *cells in values[1:]:
        for links, cell in zip(LINK_MODELS, cells):
            row = row_of(found["metrics"], condition=links, title=title)
            digit = 5.1e-4 if abs(float(row["mean"])) < 100 else 0.51
            assert float(cell.split()[0].replace(",", "")) == pytest.approx(float(row["mean"]), abs=digit)


def test_the_report_speaks(made, page, found):
    items = [html.unescape(item) for item in re.findall(r"<li>(.*?)</li>", made.report.read_text())]
    for name in (*CLASSES, "robot-robot"):
        row = row_of(found["links"], links=name)
        (said,) = (item for item in items if item.startswith(f"{name} links"))
        planar, cast = float(row["delivered_abstract"]), float(row["delivered_raycast"])
        assert f"abstract model delivers {planar:.1%}, ray casts {cast:.1%}" in said
        assert ("optimistic" in said) == (planar - cast >= 0.01) and ("pessimistic" in said) == (cast - planar >= 0.01)
    assert "3 of 3" in " ".join(items) and any("TWCR" in item for item in items)
    facts = {name: value for name, value in page.tables[-1]}
    assert facts["scenario"] == "tiny" and facts["policies"] == "greedy, random" and facts["missions"] == "3"
    assert facts["seeds"] == "30000 to 30002" and facts["radio profile"] == "matched" and facts["limitation"] == "nominal"
    gaps = {
        int(one["seed"]): abs(float(other["twcr"]) - float(one["twcr"]))
        for one, other in zip(*([r for r in found["missions"] if r["condition"] == m] for m in ("abstract", "raycast")))
    }
    assert gaps[int(facts["mission of maps and clip"])] == max(gaps.values())


def test_the_settings_are_kept(made, scenario):
    held = json.loads((made.folder / "comparison.json").read_text())
    assert (held["policies"], held["seed"], held["limitation"]) == (["greedy", "random"], 30_000, "nominal")
    assert held["scenario"]["name"] == "tiny" and held["scenario"]["n_tasks"] == scenario.n_tasks


def test_the_clip_is_around_the_first_difference(tmp_path, scenario, monkeypatch):
    asked = []

    def render_video(traces, out, camera, size, fps, speed, start, stop):
        asked.append((traces, start, stop))
        out.write_bytes(b"a video")

    monkeypatch.setattr("commhg_mj.render.render_video", render_video)
    second = 50
    monkeypatch.setattr("commhg_mj.render.first_divergence", lambda left, right: SimpleNamespace(second=second))
    path = clip.make_clip(tmp_path, scenario, "greedy", 30_001, "nominal")
    assert path == tmp_path / "side-30001.mp4" and path.read_bytes() == b"a video"
    (((left, right), start, stop),) = asked
    assert (left.links, right.links, left.seed, right.seed) == ("abstract", "raycast", 30_001, 30_001)
    assert start < second < stop <= max(left.ticks, right.ticks) and start == second - 20
    assert clip.make_clip(tmp_path, scenario, "greedy", 30_001, "nominal") == path and len(asked) == 1, "an existing one is kept"
    monkeypatch.setattr("commhg_mj.render.first_divergence", lambda left, right: None)
    clip.make_clip(tmp_path, scenario, "greedy", 30_002, "nominal")
    (left, right), start, stop = asked[1]
    assert start == 0 and 0 < stop <= max(left.ticks, right.ticks), "nothing differs: from the start on"


def test_classes_without_links_draw_without_a_warning(recwarn):
    """All robots are UAVs, say: what is not there is left out without a word on standard error."""
    episodes = np.zeros(4, BLOCKAGE)
    episodes["seconds"] = 3
    figures.blockage_figure(episodes)
    figures.delivery_figure(np.zeros(3, PAIR))
    assert [str(warning.message) for warning in recwarn] == []


@pytest.mark.filterwarnings("ignore:No artists with labels")
@pytest.mark.parametrize(
    "fields",
    [
        {"n_uav": 1, "n_ugv": 0, "n_operators": 0},
        {"n_uav": 0, "n_ugv": 3, "n_operators": 0, "n_forests": 0, "mountain_share": 0.15},
        {"n_uav": 0, "n_ugv": 2},
        {"n_forests": 0, "n_mountains": 0},
    ],
)
def test_odd_teams_and_worlds(scenario, tmp_path, monkeypatch, fields):
    monkeypatch.setattr("commhg_mj.study.comparison.run.save_figure", lambda figure, out: out.write_bytes(b"not drawn: fast"))
    monkeypatch.setattr(coverage, "CELLS", 20)
    monkeypatch.setattr(tables, "mean_interval", lambda values: Interval(np.mean(values), np.min(values), np.max(values)))
    few = {quantity: (*field, values[:1]) for quantity, (*field, values) in SWEEPS.items()}
    monkeypatch.setattr("commhg_mj.study.comparison.plan.SWEEPS", few)
    odd = change(scenario, **fields)
    page = Page(compare(odd, ["random"], 2, tmp_path, with_clip=False).read_text())
    assert page.tags["img"] == len(PNG)
    with open(tmp_path / "links.csv", newline="") as file:
        names = [row["links"] for row in csv.DictReader(file)]
    teams = {"UAV-UAV": odd.n_uav > 1, "UAV-UGV": odd.n_uav and odd.n_ugv, "UGV-UGV": odd.n_ugv > 1}
    between = [name for name, exists in teams.items() if exists]
    assert names == [*between, "robot-station", *(["robot-robot"] if between else []), "all"]
