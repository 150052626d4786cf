"""The command line: what each command does, and what bad input gets (exit code 2, one line, nothing half-written)."""

import io
import json
import os
import signal
import subprocess
import sys
import zipfile
from functools import partial

import av
import cv2
import mujoco
import numpy as np
import pytest

from commhg_mj import SCENARIOS, load_scenario, load_trace
from commhg_mj.base import charts
from commhg_mj.base.kernels import ensure_compiled
from commhg_mj.base.terms import Fate, Kind
from commhg_mj.bench import interfaces
from commhg_mj.bench import speeds as bench
from commhg_mj.cli import main
from commhg_mj.flights import fly
from commhg_mj.learning import ppo
from commhg_mj.planning import coverage
from commhg_mj.render import film
from commhg_mj.scenarios import describe
from commhg_mj.study.comparison import clip, plan

TINY = 'base = "small"\nname = "tiny"\nn_tasks = 4\ntime_limit = 30\n'


@pytest.fixture(scope="module", autouse=True)
def compiled():
    """The announcement of a first start belongs to no test."""
    ensure_compiled()


@pytest.fixture(scope="module")
def tiny(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenario") / "tiny.toml"
    path.write_text(TINY)
    return path


@pytest.fixture(scope="module")
def trace(tiny, tmp_path_factory):
    folder = tmp_path_factory.mktemp("traces")
    assert main(["run", "--scenario", str(tiny), "--out", str(folder), "--json"]) == 0
    return folder / "tiny-greedy-0.npz"


@pytest.fixture
def refused(run, tmp_path):
    """Run a command that must be refused; returns its one line."""

    def refused(*arguments):
        before = sorted(tmp_path.rglob("*"))
        code, out, err = run(*arguments)
        assert (code, out) == (2, "")
        assert err.startswith("commhg-mj: ") and err.count("\n") == 1 and err.endswith("\n"), err
        assert sorted(tmp_path.rglob("*")) == before, "something was left behind"
        return err

    return refused


def test_run_prints_a_table(run, tiny, tmp_path):
    code, out, err = run("run", "--scenario", tiny, "--missions", 2)
    assert (code, err) == (0, "")
    rows = ["TWCR", "95 %", "completed", "on time", "control time", "fatigue", "malfunctions", "bytes", "age of"]
    for word in ["tiny", "greedy", "nominal", *rows, *(name.lower() for name in Kind.__members__)]:
        assert word in out, word
    for fate in Fate.__members__:
        assert fate.lower().replace("_", " ") in out, fate
    assert not list(tmp_path.iterdir())


def test_run_prints_one_json_object_and_nothing_else(run, tiny):
    code, out, err = run("run", "--scenario", tiny, "--policy", "random", "--seed", 5, "--missions", 3, "--json")
    assert (code, err) == (0, "")
    found = json.loads(out, parse_constant=lambda constant: pytest.fail(f"{constant} is no JSON"))
    assert out.count("\n") == 1
    assert {name: found[name] for name in ("scenario", "policy", "links", "limitation", "privileged")} == {
        "scenario": "tiny", "policy": "random", "links": "raycast", "limitation": "nominal", "privileged": False,
    }  # fmt: skip
    assert [mission["seed"] for mission in found["missions"]] == [5, 6, 7]
    for name, interval in found["means"].items():
        assert interval["mean"] == pytest.approx(np.mean([mission[name] for mission in found["missions"]])), name
        assert interval["low"] <= interval["mean"] <= interval["high"], name


def test_a_single_mission_has_no_interval(run, tiny):
    found = json.loads(run("run", "--scenario", tiny, "--json")[1])
    assert found["means"]["twcr"]["low"] is None and found["means"]["twcr"]["high"] is None


def test_the_privileged_reference_is_marked(run, tiny):
    assert json.loads(run("run", "--scenario", tiny, "--policy", "omniscient", "--json")[1])["privileged"] is True
    out = run("run", "--scenario", tiny, "--policy", "omniscient")[1]
    assert "PRIVILEGED" in out


def test_limitation_and_seed_count(run, tiny):
    def missions(*arguments):
        return json.loads(run("run", "--scenario", tiny, "--policy", "random", "--json", *arguments)[1])["missions"]

    nominal = missions("--missions", 2)
    assert missions("--seed", 1) == nominal[1:]
    assert missions("--missions", 2, "--limitation", "high") != nominal


def test_workers_are_passed_on(run, tiny, monkeypatch):
    """They do not show: tests/flights/test_fly.py."""
    asked = []
    monkeypatch.setattr("commhg_mj.cli.missions.fly", lambda *rest: asked.append(rest[6]) or fly.fly(*rest[:6], 1, *rest[7:]))
    for options in ([], ["--workers", 2]):
        assert run("run", "--scenario", tiny, *options)[0] == 0
    assert asked == [1, 2]


def test_out_keeps_one_trace_a_mission(run, tiny, tmp_path):
    _, out, _ = run("run", "--scenario", tiny, "--missions", 2, "--seed", 4, "--out", "deep/er", "--json")
    missions = json.loads(out)["missions"]
    assert sorted(path.name for path in (tmp_path / "deep/er").iterdir()) == ["tiny-greedy-4.npz", "tiny-greedy-5.npz"]
    for mission in missions:
        trace = load_trace(tmp_path / f"deep/er/tiny-greedy-{mission['seed']}.npz")
        assert (trace.seed, trace.twcr(), trace.ticks) == (mission["seed"], mission["twcr"], mission["duration"])


def test_conditions_have_files_of_their_own(run, tiny, tmp_path):
    for arguments in ([], ["--limitation", "low"], ["--limitation", "high"], ["--links", "perfect"]):
        assert run("run", "--scenario", tiny, "--out", "runs", "--json", *arguments)[0] == 0
    traces = [load_trace(path) for path in (tmp_path / "runs").iterdir()]
    found = {(trace.links, trace.limitation) for trace in traces}
    assert found == {("raycast", "nominal"), ("raycast", "low"), ("raycast", "high"), ("perfect", "nominal")}


def test_video_of_a_run(run, tiny, tmp_path, monkeypatch):
    made = []
    monkeypatch.setattr("commhg_mj.cli.missions.Render.__call__", lambda self, report: made.append((*self.traces, self.out)))
    code, out, _ = run("run", "--scenario", tiny, "--seed", 3, "--missions", 2, "--video", "--json")
    assert code == 0 and json.loads(out)
    assert [tuple(map(str, paths)) for paths in made] == [("runs/tiny-greedy-3.npz", "runs/tiny-greedy-3.mp4")]
    assert (tmp_path / "runs/tiny-greedy-3.npz").exists()


def test_render_a_video(run, trace, tmp_path):
    code, out, err = run("render", trace, "--out", "v.mp4", "--size", "96x64", "--from", 5, "--to", 10, "--workers", 1)
    assert (code, out, err) == (0, "wrote v.mp4\n", "")
    with av.open("v.mp4") as video:
        frames = [(frame.width, frame.height) for frame in video.decode(video=0)]
    assert frames == [(96, 64)] * 7  # 5 s at 20 x and 24 pictures a second, both ends included
    assert [path.name for path in tmp_path.iterdir()] == ["v.mp4"]


@pytest.mark.parametrize("camera", ["overview", "station", "map", "orbit", "follow:ugv1"])
def test_render_a_picture(run, trace, camera, tmp_path):
    code, out, _ = run("render", trace, "--at", 30, "--out", "[a] picture.png", "--size", "96x64", "--camera", camera)
    assert (code, out) == (0, "wrote [a] picture.png\n")
    assert cv2.imread("[a] picture.png").shape == (64, 96, 3)
    assert len(list(tmp_path.iterdir())) == 1


def test_scenarios_shows_every_field(run, tiny, capsys):
    code, out, _ = run("scenarios")
    assert code == 0 and all(name in out for name in SCENARIOS)
    lines = {line.split()[1]: line for line in out.splitlines() if len(line.split()) > 3}
    for field, _, unit, mark, _ in describe(SCENARIOS["small"]):
        assert f" {unit} " in lines[field] and f" {mark} " in lines[field]
    _, out, _ = run("scenarios", tiny)
    lines = {line.split()[1]: line.split()[3] for line in out.splitlines() if len(line.split()) > 3}
    assert (lines["n_tasks"], lines["time_limit"], lines["map_side"]) == ("4", "30", "500")


def test_world_is_written_and_loads(run, tiny, tmp_path):
    code, out, _ = run("world", "--scenario", tiny, "--seed", 3, "--out", "w.xml")
    assert (code, out) == (0, "wrote w.xml\n")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["w.xml", "w_assets"]
    model = mujoco.MjModel.from_xml_path("w.xml")
    assert model.nmocap == load_scenario(tiny).n_robots


NO_OBSTACLES = "[world]\nn_forests = 0\nn_mountains = 0\n"


@pytest.mark.parametrize("team", ["", "n_ugv = 0\n", "n_uav = 0\nn_operators = 0\n" + NO_OBSTACLES])
def test_figure_of_any_team(run, tmp_path, team):
    (tmp_path / "team.toml").write_text(TINY + team)
    code, out, err = run("figure", "--scenario", "team.toml", "--out", "f.png")
    assert (code, out, err) == (0, "wrote f.png\n", "")
    assert cv2.imread("f.png").std() > 10


@pytest.fixture
def tiny_scales(tiny, monkeypatch):
    for name in list(SCENARIOS):
        monkeypatch.setitem(SCENARIOS, name, load_scenario(tiny))


def test_bench_prints_rates(run, tiny_scales, monkeypatch):
    few = {"n_missions": 2, "repeats": 1}
    monkeypatch.setattr(bench, "SCALING", ((2, 3),))
    monkeypatch.setattr(bench, "link_costs", partial(bench.link_costs, n_links=100, repeats=1))
    monkeypatch.setattr(bench, "missions_rates", partial(bench.missions_rates, **few))
    monkeypatch.setattr(interfaces, "interface_rates", partial(interfaces.interface_rates, steps=5, **few))
    code, out, _ = run("bench", "--scenario", "small")
    assert code == 0
    rates = ["2 missions, abstract links", "2 missions, ray-cast links", "ray-cast over abstract", "one mission alone"]
    for word in [*rates, "worlds", "one link, 16x obstacles", "CPU-us", "2 robots x 3 tasks", "ticks/CPU-s", "epochs/CPU-s"]:
        assert word in out


@pytest.mark.slow
def test_bench_times_training(run, tiny_scales, monkeypatch):
    monkeypatch.setattr(ppo.Hyper, "of", lambda n_robots, is_refining: ppo.Hyper(decisions=60, minibatches=1, epochs=1))
    code, out, _ = run("bench", "--scenario", "small", "--train")
    assert code == 0 and "training" in out and "decisions/CPU-s" in out and "GiB" in out and "ticks" not in out


def test_calibrate_prints_figures_and_rules(run, tiny_scales):
    code, out, _ = run("calibrate", "--missions", 2, "--workers", 1)
    assert code == 0
    for word in ("random", "greedy, high", "omniscient, no operators", "0.45-0.70", "BROKEN", *SCENARIOS):
        assert word in out
    code, out, _ = run("calibrate", "--scenario", "small", "--missions", 2, "--workers", 1)
    assert code == 0 and "small" in out and "medium" not in out


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["--scenario", "medum"], ["medum", "small, medium, large"]),
        (["--scenario", "none.toml"], ["none.toml", "No such file"]),
        (["--policy", "gredy"], ["gredy", "random, greedy, greedy+no-query, cbba, planner, omniscient"]),
        (["--links", "laser"], ["laser", "abstract"]),
        (["--missions", 0], ["--missions", "0"]),
        (["--workers", 0], ["--workers", "0"]),
        (["--seed", -1], ["seed", "-1"]),
        (["--seed", 2**63, "--out", "new"], ["seed", str(2**63)]),
        (["--seed", 2**63 - 1, "--missions", 2, "--out", "new"], ["seed", str(2**63)]),
        (["--out", "/proc/traces"], ["/proc/traces"]),
    ],
)
def test_bad_run(refused, arguments, said):
    line = refused("run", *arguments)
    assert all(word in line for word in said), line


def test_a_file_is_no_folder_for_traces(refused, tiny, tmp_path):
    (tmp_path / "file").touch()
    assert "file" in refused("run", "--scenario", tiny, "--out", "file")
    assert "file/in" in refused("run", "--scenario", tiny, "--out", "file/in")


@pytest.mark.parametrize(
    "arguments", ["", "fly", "run --limitation lo", "run --seed x", "run --no-such 1", "render t.npz"]
)
def test_bad_usage(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        main(arguments.split())
    assert stop.value.code == 2 and capsys.readouterr().out == ""


@pytest.mark.parametrize(
    "text, said",
    [
        ("n_uavs = 3", ["n_uavs"]),
        ("n_uav = 3.5", ["n_uav", "3.5"]),
        ("n_uav = [3]", ["n_uav", "[3]"]),
        ("n_uav = true", ["n_uav"]),
        ("n_uav = 65", ["n_uav", "0..64"]),
        ("n_uav = 0\nn_ugv = 0", ["n_uav + n_ugv", "1..64"]),
        ("n_uav = 60\nn_ugv = 5", ["n_uav + n_ugv", "65"]),
        ("n_operators = -1", ["n_operators"]),
        ("n_tasks = 0", ["n_tasks", "1..1024"]),
        ("time_limit = 1" + "0" * 400, ["time_limit"]),
        ("time_limit = " + "9" * 5000, []),
        ("map_side = nan", ["map_side"]),
        ("map_side = inf", ["map_side"]),
        ('base = "tiny"', ["base", "tiny"]),
        ("name = 5", ["name"]),
        ('name = "../escape"', ["name", "../escape"]),
        ('name = "[/red]"', ["name", "[/red]"]),
        ("world = 3", ["world", "table"]),
        ("[world]\nforests = 3", ["world.forests"]),
        ("[world]\nforest_share = [0.1]", ["world.forest_share"]),
        ("[tasks]\nvalues = []", ["tasks.values"]),
        ("[tasks]\ndeadline = 30", ["tasks.deadline"]),
        ("[tasks]\ndeadline = [30, 20]", ["tasks.deadline", "30", "20"]),
        ("[tasks]\ntype_shares = [0.5, 0.5, 0.5]", ["tasks.type_shares", "1.5"]),
        ("[communication]\nrange = [0.3, 0.2]", ["communication.range", "2"]),
        ('[communication]\nrange = ["a", "b", "c"]', ["communication.range"]),
        ('"ü" = 1', ["ü"]),
        ("n_uav = \nn_ugv = 2", ["line 1"]),
        ("a = " + "[" * 5000, []),
    ],
)
def test_bad_scenario_files(refused, tmp_path, text, said):
    (tmp_path / "bad.toml").write_text(text, encoding="utf-8")
    for arguments in (["scenarios", "bad.toml"], ["run", "--scenario", "bad.toml", "--out", "new"]):
        line = refused(*arguments)
        assert all(word in line for word in ["bad.toml", *said]), line


def test_scenario_files_that_are_none(refused, tmp_path):
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "folder.toml").mkdir()
    for name in ("binary.toml", "folder.toml"):
        assert name in refused("scenarios", name)


def test_an_empty_scenario_file_is_the_medium_one(run, tmp_path):
    (tmp_path / "empty.toml").touch()
    (tmp_path / "marked.toml").write_bytes(b"\xef\xbb\xbf" + b'base = "medium"')  # as some editors write it
    for name in ("empty.toml", "marked.toml"):
        code, out, _ = run("scenarios", name)
        assert code == 0 and out.replace(name, "medium").split() == run("scenarios", "medium")[1].split()


def test_a_world_that_does_not_fit(refused, tmp_path):
    (tmp_path / "full.toml").write_text('base = "small"\nn_tasks = 1024\n[world]\npoi_spacing = 0.1')
    for command in ("run", "world"):
        assert "n_tasks = 1024" in refused(command, "--scenario", "full.toml")


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["--out", "v.avi"], "v.avi"),
        (["--out", "video"], "video"),
        (["--out", "p.png"], "p.png"),
        (["--out", "v.mp4", "--at", 3], "v.mp4"),
        (["--out", "p.png", "--at", 30.5], "30.5"),
        (["--out", "p.png", "--at", -1], "-1"),
        (["--out", "p.png", "--at", "nan"], "nan"),
        (["--out", "v.mp4", "--from", 9, "--to", 8], "9"),
        (["--out", "v.mp4", "--to", 31], "31"),
        (["--out", "v.mp4", "--size", "big"], "big"),
        (["--out", "v.mp4", "--size", "320"], "320"),
        (["--out", "v.mp4", "--size", "321x180"], "321x180"),
        (["--out", "v.mp4", "--size", "0x0"], "0x0"),
        (["--out", "v.mp4", "--size", "99999x180"], "99999x180"),
        (["--out", "v.mp4", "--camera", "above"], "above"),
        (["--out", "v.mp4", "--camera", "follow:uav9"], "uav9"),
        (["--out", "v.mp4", "--fps", 0], "fps"),
        (["--out", "v.mp4", "--fps", 10**11], "fps"),
        (["--out", "v.mp4", "--speed", 0], "speed"),
        (["--out", "v.mp4", "--speed", "nan"], "speed"),
        (["--out", "v.mp4", "--speed", 1e-12], "speed"),
        (["--out", "v.mp4", "--workers", 0], "workers"),
        (["--out", "nowhere/v.mp4"], "nowhere/v.mp4"),
        (["--out", "/proc/v.mp4"], "/proc/v.mp4"),
        (["--out", "nowhere/p.png", "--at", 1], "nowhere/p.png"),
    ],
)
def test_bad_render(refused, trace, arguments, said):
    assert said in refused("render", trace, *arguments)


@pytest.mark.parametrize(
    "arguments, said",
    [
        ("render TRACE --out p.png --at 1 --from 2", "--from has no effect beside --at"),
        ("render TRACE --out p.png --at 1 --speed 2", "--speed has no effect beside --at"),
        ("render TRACE --out v.mp4 --coverage-height 2", "--coverage-height has no effect without --coverage"),
        ("links --trace TRACE --from uav0 --to uav1 --seed 3", "--seed has no effect beside --trace"),
        ("links --trace TRACE --from uav0 --to uav1 --limitation high", "--limitation has no effect beside --trace"),
        ("bench --train --start", "--start has no effect beside --train"),
        ("bench --peers", "--peers has no effect without --train"),
    ],
)
def test_options_without_effect(refused, trace, arguments, said):
    assert said in refused(*arguments.replace("TRACE", str(trace)).split())


def test_peers_that_are_not_installed(refused, monkeypatch):
    monkeypatch.setitem(sys.modules, "benchmarl.algorithms", None)
    assert "--peers needs BenchMARL" in refused("bench", "--train", "--peers")


@pytest.mark.parametrize(
    "arguments",
    ["evaluate --out nowhere/f.json", "coverage --out nowhere/f.png", "publish RUN --out file", "publish RUN --out file/in"],
)
def test_outputs_are_refused_before_the_work(refused, tmp_path, monkeypatch, arguments):
    for work in ("study.evaluation.evaluate", "planning.coverage.cover", "study.model_card.make_card"):
        monkeypatch.setattr(f"commhg_mj.{work}", lambda *arguments: pytest.fail("it has begun"))
    (tmp_path / "file").touch()
    assert arguments.split()[-1] in refused(*arguments.split())


def damaged_files(good: bytes):
    """(name, bytes) of files that are no trace of ours."""
    yield "empty.npz", b""
    yield "text.npz", b"hello, world\n" * 99
    yield "cut.npz", good[: len(good) // 2]
    yield "flipped.npz", bytes(byte ^ (3000 < i < 3200) for i, byte in enumerate(good))  # an array, not its header alone
    foreign, single, later = io.BytesIO(), io.BytesIO(), io.BytesIO()
    np.savez(foreign, a=np.zeros(3))
    np.save(single, np.zeros(3))
    with np.load(io.BytesIO(good)) as file:
        np.savez(later, **{**file, "format": 999})
    yield "foreign.npz", foreign.getvalue()
    yield "single.npy", single.getvalue()
    yield "later.npz", later.getvalue()


def test_damaged_and_foreign_traces(refused, trace, tmp_path):
    for name, data in damaged_files(trace.read_bytes()):
        (tmp_path / name).write_bytes(data)
        line = refused("render", name, "--at", 1, "--out", "p.png")
        assert name in line, line
    assert "format 999" in line
    (tmp_path / "folder").mkdir()
    for name in ("folder", "missing.npz"):
        assert name in refused("render", name, "--at", 1, "--out", "p.png")


@pytest.mark.parametrize("out", ["world.txt", "world", "nowhere/world.xml", "/proc/world.xml"])
def test_bad_world_paths(refused, tiny, out):
    assert out in refused("world", "--scenario", tiny, "--out", out)


def test_bad_world_and_figure(refused, tiny, tmp_path):
    (tmp_path / "folder.xml").mkdir()
    assert "folder.xml" in refused("world", "--scenario", tiny, "--out", "folder.xml")
    assert "seed" in refused("world", "--seed", -1)
    assert "f.jpg" in refused("figure", "--scenario", tiny, "--out", "f.jpg")
    assert "nowhere" in refused("figure", "--scenario", tiny, "--out", "nowhere/f.png")
    assert "--missions" in refused("calibrate", "--missions", 1)
    assert "tinny" in refused("calibrate", "--scenario", "small", "tinny")


def test_without_memory(run, tiny, monkeypatch):
    def fail(*arguments):
        raise MemoryError

    monkeypatch.setattr("commhg_mj.cli.missions.fly", fail)
    code, out, err = run("run", "--scenario", tiny)
    assert (code, out) == (2, "") and "memory" in err and err.count("\n") == 1


@pytest.mark.parametrize("error, code", [(KeyboardInterrupt(), 130), (OSError(28, "No space left on device"), 2)])
def test_interrupted_or_full_disk_while_a_trace_is_written(run, tiny, tmp_path, monkeypatch, error, code):
    def fail(file, **arrays):
        file.write(b"half")
        raise error

    monkeypatch.setattr("commhg_mj.mission.trace.np.savez_compressed", fail)
    found, out, err = run("run", "--scenario", tiny, "--out", "runs")
    assert (found, out) == (code, "") and err.count("\n") == 1
    assert not list((tmp_path / "runs").iterdir())


def test_interrupted_while_a_video_is_written(run, trace, tmp_path, monkeypatch):
    def fail(path, pictures, *settings):
        path.write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(film, "write_mp4", fail)
    (tmp_path / "v.mp4").write_bytes(b"an older one")
    assert run("render", trace, "--out", "v.mp4")[:2] == (130, "")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"v.mp4": b"an older one"}


def test_a_reader_that_goes_away(tiny):
    command = [sys.executable, "-m", "commhg_mj.cli", "scenarios", str(tiny)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        process.stdout.close()
        assert "Traceback" not in process.stderr.read()
    assert process.returncode not in (0, 2)


@pytest.mark.slow  # all is compiled to bytecode once more
def test_without_docstrings():
    done = subprocess.run([sys.executable, "-OO", "-m", "commhg_mj.cli", "scenarios", "small"], capture_output=True, text=True)
    assert done.returncode == 0 and "map_side" in done.stdout, done.stderr


@pytest.mark.parametrize("words, code", [("scenarios small >&-", 0), ("scenarios none.toml >&- 2>&-", 2)])
def test_closed_output(words, code):
    done = subprocess.run(["sh", "-c", f"exec {sys.executable} -m commhg_mj.cli {words}"], capture_output=True)
    assert (done.returncode, done.stdout, done.stderr) == (code, b"", b"")


WRITERS = {  # commands that write one file
    "run.mp4": "render TRACE --to 1 --size 64x64 --out run.mp4",
    "moment.png": "render TRACE --at 1 --size 64x64 --out moment.png",
    "what.png": "explain TRACE --robot uav0 --at 9 --out what.png",
    "cases.png": "cases TRACE --out cases.png",
    "scores.json": "evaluate --scenario TINY --policy random --missions 2 --workers 1 --out scores.json",
    "link.png": "links --scenario TINY --from uav0 --to ugv1 --out link.png",
    "cover.png": "coverage --scenario TINY --out cover.png",
    "world.xml": "world --scenario TINY --out world.xml",
    "world.png": "figure --scenario TINY --out world.png",
    "tiny-random-0.npz": "run --scenario TINY --policy random --out .",
}


@pytest.mark.parametrize("out", WRITERS)
def test_no_command_destroys_what_is_no_file(refused, trace, tiny, tmp_path, out):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / out).symlink_to("pipe")
    arguments = [{"TRACE": trace, "TINY": tiny}.get(word, word) for word in WRITERS[out].split()]
    assert f"{out}: it is no regular file" in refused(*arguments)
    (tmp_path / out).unlink()
    os.mkfifo(tmp_path / out)
    assert out in refused(*arguments)
    assert (tmp_path / out).is_fifo() and (tmp_path / "pipe").is_fifo()


@pytest.mark.parametrize("out", ["run.mp4", "moment.png", "scores.json", "link.png"])
def test_commands_follow_links(run, trace, tiny, tmp_path, out):
    (tmp_path / "real").write_bytes(b"old")
    (tmp_path / out).symlink_to("real")
    arguments = [{"TRACE": trace, "TINY": tiny}.get(word, word) for word in WRITERS[out].split()]
    assert run(*arguments)[0] == 0
    assert (tmp_path / out).is_symlink() and len((tmp_path / "real").read_bytes()) > 3


@pytest.mark.parametrize("number, code, said", [(signal.SIGINT, 130, "interrupted\n"), (signal.SIGTERM, 143, "terminated\n")])
def test_an_interrupt_and_a_termination_are_told_in_one_line(run, tiny, tmp_path, monkeypatch, number, code, said):
    def fail(file, **arrays):
        file.write(b"half")
        signal.raise_signal(number)

    monkeypatch.setattr("commhg_mj.mission.trace.np.savez_compressed", fail)
    assert run("run", "--scenario", tiny, "--out", "runs") == (code, "", said)
    assert not list((tmp_path / "runs").iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("number, code, said", [(signal.SIGINT, 130, b"interrupted\n"), (signal.SIGTERM, 143, b"terminated\n")])
def test_an_interrupt_stops_all_workers(tmp_path, number, code, said):
    """The whole process group gets it, as from a terminal; what is under way ends there and then."""
    command = [sys.executable, "-m", "commhg_mj.cli", "run", "--scenario", "small", "--missions", "5000"]
    command += ["--workers", "2", "--out", str(tmp_path)]
    with subprocess.Popen(command, start_new_session=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        try:
            while not list(tmp_path.glob("*.npz")) and process.poll() is None:
                signal.sigtimedwait([], 0.1)
            os.killpg(process.pid, number)
            out, err = process.communicate(timeout=60)  # all missions would take many minutes
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            raise
    assert (process.returncode, out, err) == (code, b"", said)
    assert all(zipfile.is_zipfile(path) for path in tmp_path.iterdir())


def cells(out):
    """A printed table as {row: its other cells}."""
    rows = ([cell.strip() for cell in line.strip("│").split("│")] for line in out.splitlines() if line.startswith("│"))
    return {name: others for name, *others in rows}


@pytest.mark.parametrize("links", ["abstract", "abstract-fit", "raycast-shuffled"])
def test_run_under_other_links(run, tiny, tmp_path, links):
    arguments = ["run", "--scenario", tiny, "--missions", 2, "--json", "--out", "runs"]
    found = json.loads(run(*arguments, "--links", links)[1])
    assert found["links"] == links and len(found["missions"]) == 2
    assert sorted(path.name for path in (tmp_path / "runs").iterdir()) == [f"tiny-greedy-{links}-{seed}.npz" for seed in (0, 1)]
    trace = load_trace(tmp_path / f"runs/tiny-greedy-{links}-1.npz")
    assert (trace.links, trace.seed, trace.twcr()) == (links, 1, found["missions"][1]["twcr"])


def test_traces_are_named_after_their_conditions(run, tiny, tmp_path):
    for arguments in (
        ["--radio-profile", "matched"],
        ["--radio-profile", "edge"],
        ["--links", "abstract", "--radio-profile", "radio", "--limitation", "high"],
        ["--links", "abstract", "--limitation", "low", "--policy", "random", "--seed", 7],
    ):
        assert run("run", "--scenario", tiny, "--out", "runs", "--json", *arguments)[0] == 0
    assert {path.name for path in (tmp_path / "runs").iterdir()} == {
        "tiny-greedy-0.npz", "tiny-greedy-edge-0.npz", "tiny-greedy-abstract-radio-high-0.npz", "tiny-random-abstract-low-7.npz",
    }  # fmt: skip
    trace = load_trace(tmp_path / "runs/tiny-greedy-abstract-radio-high-0.npz")
    assert (trace.links, trace.limitation, trace.scenario.radio.profile) == ("abstract", "high", "radio")


def test_profiles_matter_to_ray_casts_alone(run, tiny):
    def twcr(links, profile):
        arguments = ["--links", links, "--radio-profile", profile, "--missions", 3, "--json"]
        return [mission["messages"] for mission in json.loads(run("run", "--scenario", tiny, *arguments)[1])["missions"]]

    assert twcr("abstract", "matched") == twcr("abstract", "radio")
    assert twcr("raycast", "matched") != twcr("raycast", "radio")


def test_links_prints_both_models(run, tiny):
    code, out, err = run("links", "--scenario", tiny, "--from", "uav0", "--to", "station", "--at", 20)
    assert (code, err) == (0, "")
    assert "uav0 to station, telemetry of 40 B" in out and "abstract" in out and "raycast" in out
    table = cells(out)
    for row in ("line of sight", "metres in forest", "free-space loss (dB)", "SNR (dB)", "delivered in time", "lost"):
        assert len(table[row]) == 2, row
    for i in range(2):
        shares = [float(table[row][i]) for row in ("delivered in time", "delivered late", "lost")]
        assert sum(shares) == pytest.approx(1, abs=2e-4) and shares[0] > 0


@pytest.mark.parametrize("ends", [("uav0", "ugv1"), ("ugv0", "station"), ("station", "100,30,4"), ("10,10", "uav1")])
def test_a_trace_and_a_flight_say_the_same(run, tiny, trace, ends):
    options = ["--from", ends[0], "--to", ends[1], "--at", 25]
    flown = run("links", "--scenario", tiny, *options)
    assert flown == run("links", "--trace", trace, *options) and flown[0] == 0 and ends[0] in flown[1]


def test_links_takes_its_conditions_from_the_trace(run, tiny, tmp_path):
    run("run", "--scenario", tiny, "--out", "runs", "--seed", 3, "--limitation", "high", "--links", "abstract", "--json")
    ends = ["--from", "60,20", "--to", "100,20"]
    code, out, _ = run("links", *ends, "--trace", "runs/tiny-greedy-abstract-high-3.npz")
    assert code == 0 and cells(out)["range (m)"] == ["30", "30"], "0.06 of 500 m"
    assert out == run("links", *ends, "--scenario", tiny, "--seed", 3, "--limitation", "high")[1]


def test_links_draws_a_cross_section(run, tiny, tmp_path):
    code, out, err = run("links", "--scenario", tiny, "--from", "uav0", "--to", "400,400", "--out", "[a] cut.PNG")
    assert (code, err) == (0, "") and out.endswith("wrote [a] cut.PNG\n")
    assert cv2.imread("[a] cut.PNG").std() > 5 and len(list(tmp_path.iterdir())) == 1


def test_coverage_draws_a_map(run, tiny, tmp_path, monkeypatch):
    monkeypatch.setattr(coverage, "CELLS", 40)
    code, out, err = run("coverage", "--scenario", tiny, "--from", "250,200,9", "--height", 3, "--out", "c.png")
    assert (code, err) == (0, "")
    planar, rays, wrote = out.splitlines()
    assert planar.startswith("abstract: mean delivery 0.") and rays.startswith("raycast: mean delivery 0.")
    assert wrote == "wrote c.png"
    assert cv2.imread("c.png").std() > 10 and len(list(tmp_path.iterdir())) == 1
    _, out, _ = run("coverage", "--scenario", tiny, "--limitation", "high", "--out", "s.png")
    assert out.startswith("abstract: mean delivery 0.8500, at least one half on 100.0% of the map\n")


@pytest.mark.parametrize("profile", ["matched", "edge", "radio"])
def test_coverage_takes_profiles(run, tmp_path, monkeypatch, profile):
    """Without obstacles the planar map is the range's disc around the middle; only matched ray casts end there too."""
    monkeypatch.setattr(coverage, "CELLS", 40)
    (tmp_path / "bare.toml").write_text(TINY + NO_OBSTACLES + "[communication]\nrange = [0.4, 0.1, 0.1]\n")
    arguments = ["--scenario", "bare.toml", "--from", "250,250", "--radio-profile", profile, "--out", "c.png"]
    planar, rays, _ = run("coverage", *arguments)[1].splitlines()
    half = [float(line.split("half on ")[1].split("%")[0]) / 100 for line in (planar, rays)]
    assert half[0] == pytest.approx(np.pi * 0.4**2, abs=0.01)
    assert half[1] == pytest.approx(half[0], abs=1e-9) if profile == "matched" else half[1] > half[0]


@pytest.mark.parametrize("source", ["station", "250,200,9"])
def test_render_drapes_coverage(run, trace, tmp_path, monkeypatch, source):
    monkeypatch.setattr(coverage, "CELLS", 40)
    arguments = ["render", trace, "--at", 10, "--size", "96x64", "--camera", "map"]
    assert run(*arguments, "--out", "plain.png")[0] == 0
    code, out, err = run(*arguments, "--out", "draped.png", "--coverage", source)
    assert (code, out, err) == (0, "wrote draped.png\n", "")
    plain, draped = (cv2.imread(name).astype(int) for name in ("plain.png", "draped.png"))
    assert np.mean(np.abs(plain - draped).sum(axis=-1) > 30) > (0.2 if source == "station" else 0.05)


def test_fit_prints_the_fields_of_abstract_fit(run, tiny, tiny_scales):
    code, out, _ = run("fit", "--scenario", tiny, "--missions", 2, "--workers", 1)
    assert code == 0 and "radio.fitted_forest_decay (m)" in out and out.count("| tiny") == 1
    assert run("fit", "--missions", 1, "--workers", 1)[1].count("| tiny") == 3


@pytest.fixture
def small_comparison(monkeypatch):
    """Comparisons with rough pictures and two short sweeps."""
    monkeypatch.setattr(coverage, "CELLS", 20)
    monkeypatch.setattr(charts, "DPI", 20)
    monkeypatch.setattr(clip, "SIZE", (96, 64))
    monkeypatch.setattr(clip, "FPS", 1)
    monkeypatch.setattr(plan, "SWEEPS", {name: (*field, values[:1]) for name, (*field, values) in plan.SWEEPS.items()})


def test_compare_writes_a_report(run, tiny, small_comparison, tmp_path):
    arguments = ["compare", "--scenario", tiny, "--missions", 2, "--workers", 1, "--policy", "random", "--out", "deep/er"]
    code, out, err = run(*arguments, "--seed", 5)
    assert (code, out) == (0, "wrote deep/er/report.html\n")
    page = (tmp_path / "deep/er/report.html").read_text()
    assert 'src="data:video/mp4;base64,' in page and "5 to 6" in page and "random" in page
    (video,) = (tmp_path / "deep/er").glob("side-*.mp4")
    with av.open(str(video)) as film_:
        frames = [(frame.width, frame.height) for frame in film_.decode(video=0)]
    assert len(frames) >= 2 and frames[0][0] >= 2 * 96
    assert sorted(path.name for path in tmp_path.iterdir()) == ["deep"]
    code, out, err = run(*arguments, "--seed", 6)
    assert (code, out) == (2, "") and "deep/er" in err and "another seed" in err and err.count("\n") == 1


def test_compare_passes_its_options_on(run, tiny, monkeypatch):
    asked = []
    monkeypatch.setattr("commhg_mj.study.comparison.compare", lambda *arguments: asked.append(arguments) or "x/report.html")
    options = ["--policy", "random", "greedy", "--missions", 4, "--seed", 9, "--limitation", "low", "--radio-profile", "edge"]
    code, out, _ = run("compare", "--scenario", tiny, "--out", "x", *options, "--workers", 3, "--no-clip")
    assert (code, out) == (0, "wrote x/report.html\n")
    scenario, policies, missions, out, seed, limitation, workers, with_clip, _ = asked[0]
    assert (tuple(policies), missions, str(out), seed, limitation, workers) == (("random", "greedy"), 4, "x", 9, "low", 3)
    assert scenario.radio.profile == "edge" and scenario.name == "tiny" and with_clip is False
    assert run("compare", "--scenario", tiny, "--out", "x")[0] == 0
    scenario, policies, missions, _, seed, limitation, _, with_clip, _ = asked[1]
    assert (policies, missions, seed, limitation, with_clip) == (("greedy",), 200, 30_000, "nominal", True)
    assert scenario.radio.profile == "matched"


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["links", "--from", "uav9", "--to", "uav0"], "--from must be station, uav0"),
        (["links", "--from", "uav0", "--to", "nowhere"], "--to must be station, uav0"),
        (["links", "--from", "uav0", "--to", "900,3"], "--to 900,3"),
        (["links", "--from", "uav0", "--to", "1,1,-3"], "--to 1,1,-3"),
        (["links", "--from", "uav0", "--to", "uav0"], "--from and --to are the same place, uav0"),
        (["links", "--from", "uav0", "--to", "uav1", "--at", 31], "--at 31 lies outside the mission, 0..30 s"),
        (["links", "--from", "uav0", "--to", "uav1", "--at", -1], "--at -1 lies outside the mission"),
        (["links", "--from", "uav0", "--to", "uav1", "--at", "nan"], "--at nan lies outside the mission"),
        (["links", "--from", "uav0", "--to", "uav1", "--seed", -1], "seed"),
        (["links", "--from", "uav0", "--to", "uav1", "--out", "l.jpg"], "--out l.jpg"),
        (["links", "--from", "uav0", "--to", "uav1", "--out", "l"], "--out l:"),
        (["links", "--from", "uav0", "--to", "uav1", "--out", "nowhere/l.png"], "nowhere/l.png"),
        (["links", "--from", "uav0", "--to", "uav1", "--trace", "none.npz"], "none.npz"),
        (["coverage", "--out", "c.pdf"], "--out c.pdf"),
        (["coverage", "--out", "nowhere/c.png"], "nowhere/c.png"),
        (["coverage", "--out", "c.png", "--from", "ugv0"], "--from must be station, X,Y or X,Y,Z, is 'ugv0'"),
        (["coverage", "--out", "c.png", "--from", "ugv7"], "--from must be station"),
        (["coverage", "--out", "c.png", "--from", "501,1"], "--from 501,1"),
        (["coverage", "--out", "c.png", "--height", -1], "--height"),
        (["coverage", "--out", "c.png", "--height", "nan"], "--height"),
        (["coverage", "--out", "c.png", "--seed", -1], "seed"),
        (["fit", "--missions", 0], "--missions"),
        (["fit", "--workers", 0], "--workers"),
        (["compare", "--out", "c", "--missions", 1], "--missions must be at least 2"),
        (["compare", "--out", "c", "--workers", 0], "--workers"),
        (["compare", "--out", "c", "--seed", -1], "seed"),
        (["compare", "--out", "c", "--seed", 2**63 - 1, "--missions", 2], "seed"),
        (["compare", "--out", "c", "--policy", "gredy"], "'gredy'"),
        (["compare", "--out", "c", "--policy", "greedy", "omniscient"], "'omniscient'"),
        (["compare", "--out", "/proc/c"], "--out /proc/c"),
    ],
)  # fmt: skip
def test_bad_link_commands(refused, tiny, arguments, said):
    assert said in refused(*arguments[:1], "--scenario", tiny, *arguments[1:])


@pytest.mark.parametrize("command", ["links --from uav0 --to uav1", "coverage --out c.png", "fit", "compare --out c"])
@pytest.mark.parametrize("scenario", ["medum", "none.toml"])
def test_link_commands_refuse_unknown_scenarios(refused, command, scenario):
    assert scenario in refused(*command.split(), "--scenario", scenario)


def test_links_of_damaged_traces(refused, trace, tmp_path):
    for name, data in damaged_files(trace.read_bytes()):
        (tmp_path / name).write_bytes(data)
        assert name in refused("links", "--from", "uav0", "--to", "station", "--trace", name)
    assert "--at 31 lies" in refused("links", "--from", "uav0", "--to", "uav1", "--trace", trace, "--at", 31)


PROFILED = ["run", "links --from uav0 --to uav1", "coverage --out c.png", "compare --out c"]


@pytest.mark.parametrize("command", PROFILED)
def test_profiles_by_name_only(command, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as stop:
        main([*command.split(), "--radio-profile", "best"])
    captured = capsys.readouterr()
    assert stop.value.code == 2 and captured.out == "" and "radio-profile" in captured.err and not list(tmp_path.iterdir())


@pytest.mark.parametrize("profile, low, high", [("matched", 12.58, 12.60), ("edge", 20, 27.59), ("radio", 0, 0)])
def test_links_takes_profiles(run, tiny, profile, low, high):
    """The small map's system loss: 15 dB of margin at 150 m, 95 % at 150 m, and none."""
    code, out, _ = run("links", "--scenario", tiny, "--from", "100,20", "--to", "station", "--radio-profile", profile)
    assert code == 0 and low <= float(cells(out)["system loss (dB)"][1]) <= high


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["--coverage", "nowhere"], "--coverage must be station, uav0"),
        (["--coverage", "501,3"], "--coverage 501,3"),
        (["--coverage", "uav0"], "--coverage"),
        (["--coverage", "station", "--coverage-height", -1], "--coverage-height"),
    ],
)  # fmt: skip
def test_bad_coverage_of_a_picture(refused, trace, arguments, said):
    assert said in refused("render", trace, "--at", 1, "--size", "96x64", "--out", "p.png", *arguments)


@pytest.mark.parametrize("at", [-1, "nan"])
def test_a_second_before_the_mission_is_told_how_long_it_is(refused, tiny, at):
    assert "0..30 s" in refused("links", "--scenario", tiny, "--from", "uav0", "--to", "uav1", "--at", at)


def test_compare_without_any_policy(refused, tiny):
    assert "policy" in refused("compare", "--scenario", tiny, "--out", "c", "--policy")
