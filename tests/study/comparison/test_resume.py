"""A comparison that goes on: only what a folder lacks is flown, and the tables never show how they came to be."""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from strategies import change

from commhg_mj.flights import fly as flying
from commhg_mj.flights.fly import fly
from commhg_mj.scenarios import SCENARIOS
from commhg_mj.study.comparison import flown_parts as flights
from commhg_mj.study.comparison import plan as planning
from commhg_mj.study.comparison import run

TINY = change(
    SCENARIOS["small"], name="tiny", n_tasks=4, time_limit=40, forest_share=0.3, n_forests=8, uav_height=15.0,
    range=(0.2, 0.15, 0.1),
)  # fmt: skip
SWEEP = {"foliage rate (dB/m)": ("radio", "foliage_rate", (0.1, 0.8))}
MISSIONS, CHUNK = 3, 2
CONDITIONS = 4 + 2 + 2  # models and the shuffled control, the control without obstacles, the sweep
FLIGHTS = (CONDITIONS + 1) * MISSIONS  # and links are looked at


@pytest.fixture(scope="module", autouse=True)
def tables_only():
    """Neither pictures nor a report, a single sweep, small parts."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run, "_draw", lambda *arguments: {})
        patch.setattr(run, "write_report", lambda folder, *arguments: folder / "report.html")
        patch.setattr(planning, "SWEEPS", SWEEP)
        patch.setattr(flying, "CHUNK", CHUNK)
        yield


def compare(folder, scenario=TINY, policies=("greedy",), missions=MISSIONS, **options):
    """A comparison; returns how many flights it told of, one by one."""
    told = []
    run.compare(scenario, policies, missions, folder, with_clip=False, advance=told.append, **options)
    return told


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    folder = tmp_path_factory.mktemp("first") / "run"
    assert sum(compare(folder)) == FLIGHTS
    return folder


@pytest.fixture
def folder(first, tmp_path):
    """A copy of the first run, its files an hour old."""
    copy = tmp_path / "run"
    shutil.copytree(first, copy)
    for path in copy.rglob("*"):
        os.utime(path, (path.stat().st_atime - 3600,) * 2)
    return copy


def csv_files(folder):
    return {path.name: path.read_bytes() for path in folder.glob("*.csv")}


def parts(folder):
    """{part: when it was written}."""
    return {path.name: path.stat().st_mtime_ns for path in (folder / "parts").iterdir()}


def test_what_a_run_leaves(first):
    names = sorted(path.name for path in (first / "parts").iterdir())
    assert len(names) == CONDITIONS * 2 + MISSIONS and "abstract-30000-2.json" in names and "abstract-30002-1.json" in names
    assert len(csv_files(first)) == 9 and not list(first.rglob("*.part*")) and not list(first.rglob(".*"))


def test_nothing_is_flown_twice(first, folder, monkeypatch):
    monkeypatch.setattr(flights, "fly_to_end", lambda *arguments, **options: pytest.fail("it flies"))
    before = parts(folder)
    assert sum(compare(folder)) == FLIGHTS, "what is there counts as done"
    assert parts(folder) == before and csv_files(folder) == csv_files(first)


def test_only_what_is_missing_or_damaged_is_flown(first, folder, monkeypatch):
    kept, flown = folder / "parts", []
    (kept / "raycast-30002-1.json").unlink()
    (kept / "links-30001.npz").unlink()
    text = (kept / "abstract-30000-2.json").read_text()
    (kept / "abstract-30000-2.json").write_text(text[: len(text) // 2])  # cut
    (kept / "abstract-fit-30000-2.json").write_bytes(b"")
    (kept / "raycast-shuffled-30000-2.json").write_bytes(b"\xff\x00" + text.encode()[2:])
    archive = bytearray((kept / "links-30000.npz").read_bytes())
    archive[200:260] = bytes(60)
    (kept / "links-30000.npz").write_bytes(archive)
    (kept / "links-30002.npz").write_bytes((kept / "links-30002.npz").read_bytes()[:300])
    lost = {"raycast-30002-1.json", "abstract-30000-2.json", "abstract-fit-30000-2.json", "raycast-shuffled-30000-2.json"}
    lost |= {f"links-{seed}.npz" for seed in (30_000, 30_001, 30_002)}
    before, fly_to_end = parts(first), flights.fly_to_end

    def spy(policy, scenario, seeds, links, *rest, **options):
        flown.extend((links, seed) for seed in seeds)
        return fly_to_end(policy, scenario, seeds, links, *rest, **options)

    old = parts(folder)
    monkeypatch.setattr(flights, "fly_to_end", spy)
    assert sum(compare(folder)) == FLIGHTS
    again = [(links, seed) for links in ("abstract", "abstract-fit", "raycast-shuffled") for seed in (30_000, 30_001)]
    again += [("raycast", seed) for seed in (30_002, 30_000, 30_001, 30_002)]
    assert sorted(flown) == sorted(again)
    new = parts(folder)
    assert set(new) == set(before) and {name for name in new if new[name] != old.get(name)} == lost
    for name in lost:
        if name.endswith(".json"):
            assert (folder / "parts" / name).read_bytes() == (first / "parts" / name).read_bytes()
    assert csv_files(folder) == csv_files(first)


def test_more_missions_join(first, folder, tmp_path):
    """Parts that were full stay; the tables are those of a comparison that flew all of them at once."""
    before = parts(folder)
    assert sum(compare(folder, missions=5)) == (CONDITIONS + 1) * 5
    after = parts(folder)
    assert set(before) < set(after) and all(after[name] == written for name, written in before.items())
    compare(tmp_path / "fresh", missions=5)
    assert csv_files(folder) == csv_files(tmp_path / "fresh") != csv_files(first)
    rows = csv_files(folder)["metrics.csv"].decode().splitlines()
    mean = next(float(row.split(",")[3]) for row in rows if row.startswith("abstract,twcr"))
    assert mean == pytest.approx(np.mean([score.twcr for score in fly(TINY, "greedy", range(30_000, 30_005))]))
    compare(folder)
    assert csv_files(folder) == csv_files(first), "and fewer again"


OTHERS = [
    ({"policies": ["random"]}, "another policies"),
    ({"policies": ["greedy", "random"]}, "another policies"),
    ({"first_seed": 30_001}, "another seed"),
    ({"limitation": "low"}, "another limitation"),
    ({"scenario": change(TINY, n_tasks=5)}, "another scenario"),
    ({"scenario": change(TINY, profile="edge")}, "another scenario"),
    ({"scenario": change(TINY, name="other")}, "another scenario"),
]


def snapshot(folder):
    return {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("options, said", OTHERS)
def test_another_comparison_is_refused(folder, options, said):
    before = snapshot(folder)
    with pytest.raises(ValueError, match=f"{folder}.* has {said}; choose another folder"):
        compare(folder, **options)
    assert snapshot(folder) == before


@pytest.mark.parametrize("field", ["kernels", "format"])
def test_another_version_is_refused(folder, field):
    path = folder / "comparison.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {field: "other"}))
    before = snapshot(folder)
    with pytest.raises(ValueError, match="was made by another version; choose another folder"):
        compare(folder)
    assert snapshot(folder) == before


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "hello",
        *(text for text in ("[1]", "3", '"x"')),
    ],
)
def test_damaged_settings_are_refused(tmp_path, text):
    (tmp_path / "comparison.json").write_text(text)
    with pytest.raises(ValueError, match="comparison.json"):
        compare(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["comparison.json"]


@pytest.mark.parametrize(
    "policies, said",
    [
        (["gredy"], "unknown policy 'gredy'"),
        (["greedy", "gredy"], "unknown policy 'gredy'"),
        (["omniscient"], "policy 'omniscient' communicates for free"),
        (["greedy", "omniscient"], "policy 'omniscient' communicates for free"),
        ([], "policy: at least one"),
    ],
)
def test_impossible_policies_are_refused(tmp_path, policies, said):
    with pytest.raises(ValueError, match=said):
        compare(tmp_path / "new", policies=policies)
    assert not (tmp_path / "new").exists()


def test_a_policy_named_twice_flies_once(first, folder):
    assert sum(compare(folder, policies=["greedy", "greedy"])) == FLIGHTS
    assert csv_files(folder) == csv_files(first)


@pytest.mark.parametrize("place", ["file", "file/in"])
def test_a_file_is_no_folder(tmp_path, place):
    (tmp_path / "file").write_text("keep me")
    with pytest.raises(ValueError, match=f"--out {tmp_path / place}"):
        compare(tmp_path / place)
    assert (tmp_path / "file").read_text() == "keep me"


@pytest.mark.parametrize("flights_before", [1, 7, 20, FLIGHTS - 1])
def test_an_interrupted_run_goes_on(first, tmp_path, flights_before):
    told = []

    def interrupt(missions):
        told.append(missions)
        if sum(told) >= flights_before:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run.compare(TINY, ["greedy"], MISSIONS, tmp_path / "run", with_clip=False, advance=interrupt)
    left = parts(tmp_path / "run")
    assert not csv_files(tmp_path / "run") and 0 < len(left) < CONDITIONS * 2 + MISSIONS + (flights_before == FLIGHTS - 1)
    for path in (tmp_path / "run" / "parts").iterdir():
        if path.suffix == ".json":
            assert path.read_bytes() == (first / "parts" / path.name).read_bytes(), "whole or not there"
    assert sum(compare(tmp_path / "run")) == FLIGHTS
    after = parts(tmp_path / "run")
    assert all(after[name] == written for name, written in left.items()) and csv_files(tmp_path / "run") == csv_files(first)


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(28, "No space left on device")])
def test_interrupted_while_a_part_is_written(first, tmp_path, monkeypatch, error):
    write_text, count = Path.write_text, [0]

    def fail(path, text, *arguments, **options):
        count[0] += path.parent.name == "parts"
        if count[0] == 4:
            write_text(path, text[: len(text) // 2])
            raise error
        return write_text(path, text, *arguments, **options)

    monkeypatch.setattr(Path, "write_text", fail)
    with pytest.raises(KeyboardInterrupt if isinstance(error, KeyboardInterrupt) else ValueError):
        compare(tmp_path)
    monkeypatch.undo()
    assert len(parts(tmp_path)) == 3 and not list(tmp_path.rglob("*part.*")) and not list(tmp_path.rglob(".*"))
    compare(tmp_path)
    assert csv_files(tmp_path) == csv_files(first)


def test_interrupted_while_a_table_is_written(first, folder, monkeypatch):
    def fail(self, rows):
        raise KeyboardInterrupt

    old = csv_files(folder)
    monkeypatch.setattr("csv.DictWriter.writerows", fail)
    with pytest.raises(KeyboardInterrupt):
        compare(folder)
    assert csv_files(folder) == old and not list(folder.rglob(".*"))


@pytest.mark.slow
def test_processes_do_not_show(first, tmp_path):
    assert sum(compare(tmp_path, workers=2)) == FLIGHTS
    assert csv_files(tmp_path) == csv_files(first)
    assert set(parts(tmp_path)) == set(parts(first))
