"""`commhg-mj train` and `commhg-mj evaluate`."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
import torch
from learners import FAMILIES, QUICK
from safetensors import safe_open

from commhg_mj.base.files import LOCK, held
from commhg_mj.base.kernels import ensure_compiled
from commhg_mj.cli.training import Train
from commhg_mj.flights.statistics import mean_interval, middle_interval
from commhg_mj.learning import curriculum, ppo, train
from commhg_mj.learning.distributed import ProcessGroup
from commhg_mj.learning.registry import find_method
from commhg_mj.learning.train import Plan
from commhg_mj.learning.weights import load_weights, save_weights
from commhg_mj.scenarios import SCENARIOS, load_scenario

TINY = 'base = "small"\nname = "tiny"\nn_tasks = 4\ntime_limit = 40\n'


@pytest.fixture(scope="module", autouse=True)
def quick():
    """A few decisions an update."""
    ensure_compiled()
    of = lambda n_robots, is_refining, **others: replace(QUICK, entropy=0.0 if is_refining else QUICK.entropy, **others)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ppo.Hyper, "of", of)
        patch.setitem(sys.modules, "torch.utils.tensorboard", None)
        yield


@pytest.fixture
def tiny(tmp_path):
    path = tmp_path / "tiny.toml"
    path.write_text(TINY)
    return path


@pytest.fixture
def refused(run):
    """Run a command that must be refused; returns its one line."""

    def refused(*arguments):
        code, out, err = run(*arguments)
        assert (code, out) == (2, "")
        assert err.startswith("commhg-mj: ") and err.count("\n") == 1, err
        return err

    return refused


def options(tiny, out, **more):
    more = {"scenario": tiny, "out": out, "missions": 12, "side-by-side": 6, **more}
    return [word for name, value in more.items() for word in (f"--{name}", value)]


@pytest.mark.parametrize("method", FAMILIES)
def test_train_then_evaluate(run, tiny, tmp_path, method):
    code, out, err = run("train", *options(tiny, "r", method=method, missions=4))
    assert code == 0 and "weights.safetensors after" in out and "update    1" in err and "TWCR" in err
    files = [".lock", "log.csv", "plan.json", "state.pt", "weights.safetensors"]
    assert sorted(path.name for path in (tmp_path / "r").iterdir()) == files
    weights = "r/weights.safetensors"
    code, out, err = run(
        "evaluate", "--policy", "greedy", weights, "--scenario", tiny, "--missions", 4, "--workers", 1, "--out", "e.json"
    )  # fmt: skip
    assert code == 0 and "held-out" in out and "minus greedy" in out
    labels = [line.split()[0] for line in out.replace("│", " ").splitlines() if line.split()]
    assert any(label.startswith("r-") for label in labels), "weights go by their run's name"
    stored = json.loads((tmp_path / "e.json").read_text())
    (under,) = stored["conditions"]
    assert (under["scenario"], under["links"], under["limitation"], stored["missions"]) == ("tiny", "raycast", "nominal", 4)
    assert set(under["twcr"]) == {"greedy", weights} and all(len(column) == 4 for column in under["twcr"].values())
    assert all(np.isfinite(column).all() for column in under["twcr"].values())


def test_evaluate_takes_several_scenarios_links_and_limitations_and_sums_up(run, tiny):
    code, out, err = run(
        "evaluate", "--policy", "greedy", "random", "--scenario", tiny, "small", "--links", "abstract", "perfect",
        "--limitation", "high", "--missions", 2, "--workers", 1, "--out", "e.json",
    )  # fmt: skip
    assert code == 0, err
    conditions = [f"{name}, {links} links, high limitation" for name in ("tiny", "small") for links in ("abstract", "perfect")]
    assert all(out.count(f"{condition}, 2 held-out missions") == 1 for condition in conditions)
    assert "TWCR of greedy, the others minus greedy, 2 held-out missions" in out and out.count("| random") == 1
    stored = json.loads(open("e.json").read())["conditions"]
    assert [f"{each['scenario']}, {each['links']} links, {each['limitation']} limitation" for each in stored] == conditions


def test_resume_goes_on_where_an_interrupted_run_stood(run, tiny, tmp_path, monkeypatch):
    update = train.Training.update

    def interrupt(training):
        if training.updates == 2:
            raise KeyboardInterrupt
        return update(training)

    monkeypatch.setattr(train.Training, "update", interrupt)
    code, _, err = run("train", *options(tiny, "r", method="mappo", missions=30))
    assert code == 130 and err.splitlines()[-1].endswith("commhg-mj train --resume --out r") and err.count("interrupted") == 1
    monkeypatch.setattr(train.Training, "update", update)
    assert train.Training.resume(tmp_path / "r").updates == 2
    assert run("train", "--out", "r", "--resume")[0] == 0
    assert run("train", *options(tiny, "whole", method="mappo", missions=30))[0] == 0
    one, other = (torch.load(tmp_path / name / "state.pt", weights_only=True) for name in ("r", "whole"))
    assert all(torch.equal(one["method"][key], other["method"][key]) for key in one["method"])
    assert one["counts"][:2] == other["counts"][:2] and one["counts"][0] > 2
    updates = [line.split(",")[0] for line in (tmp_path / "r" / "log.csv").read_text().splitlines()]
    assert updates == ["update", *map(str, range(1, one["counts"][0] + 1))]
    # A run that is done stays as it is.
    before = (tmp_path / "r" / "state.pt").read_bytes()
    code, out, _ = run("train", "--out", "r", "--resume")
    assert code == 0 and "nothing was left to do: all 30 missions are flown" in out
    assert (tmp_path / "r" / "state.pt").read_bytes() == before


def same_run(one, other):
    """Whether two runs' folders hold the same networks, counts and schedule."""
    one, other = (torch.load(folder / "state.pt", weights_only=True) for folder in (one, other))
    plans = [json.loads(state["plan"]) for state in (one, other)]
    same = all(torch.equal(one["method"][key], other["method"][key]) for key in one["method"])
    return same and one["counts"][:3] == other["counts"][:3] and plans[0] == plans[1]


@pytest.mark.parametrize("begun", [True, False], ids=["at one rate", "before its first update"])
def test_a_run_is_lengthened_to_the_bits_of_a_longer_one(run, tiny, tmp_path, monkeypatch, begun):
    if begun:
        monkeypatch.setattr(ppo.Learner, "set_rate", lambda learner, *how: None)
        assert run("train", *options(tiny, "r", missions=1, method="mappo"))[0] == 0
    else:
        with monkeypatch.context() as patch:
            patch.setattr(train.Training, "update", lambda training: signal.raise_signal(signal.SIGINT))
            assert run("train", *options(tiny, "r", missions=1, method="mappo"))[0] == 130
    code, out, _ = run("train", "--resume", "--out", "r", "--missions", 10)
    assert code == 0 and "nothing" not in out
    assert run("train", *options(tiny, "whole", missions=10, method="mappo"))[0] == 0
    assert same_run(tmp_path / "r", tmp_path / "whole")
    assert (tmp_path / "r/plan.json").read_text() == (tmp_path / "whole/plan.json").read_text()


def test_a_run_that_was_lengthened_and_killed_is_as_long_as_its_plan(run, tiny, tmp_path):
    assert run("train", *options(tiny, "r", missions=1, method="mappo"))[0] == 0
    plan = curriculum.read_plan(tmp_path / "r")
    curriculum.write_plan(replace(plan, missions=10), tmp_path / "r")  # and no update after it
    assert run("train", "--resume", "--out", "r")[0] == 0
    assert train.Training.resume(tmp_path / "r").missions >= 10


def test_what_cannot_change_is_refused_beside_resume(run, refused, tiny, tmp_path):
    own = options(tiny, "r", seed=3, method="mappo")
    assert run("train", *own)[0] == 0
    before = {path: path.read_bytes() for path in (tmp_path / "r").iterdir()}
    for changes, said in {
        ("--seed", 0): "--seed 0 (it has 3)",
        ("--seed", 1796000000123456789): "--seed 1796000000123456789 (it has 3)",
        ("--lam", 0.9, "--side-by-side", 7): "--side-by-side 7 (it has 6), --lam 0.9 (it has 0.95)",
        ("--scenario", "medium"): "--scenario medium (it has 'tiny')",
        ("--init", "small-to-large", "--workers", 2, "--missions", 99): "--workers 2",
        ("--missions", 5): "--missions 5: the run in r has 12 and can only become longer",
    }.items():
        assert said in refused("train", "--resume", "--out", "r", *changes)
    assert before == {path: path.read_bytes() for path in (tmp_path / "r").iterdir()}
    assert run("train", "--resume", *own)[0] == 0, "its own options are no change"


HOLD = "import sys; from filelock import FileLock\nwith FileLock(sys.argv[1]): print(flush=True); sys.stdin.read()"


@pytest.fixture
def hold(tmp_path):
    """Let another process hold a folder; returns that process."""
    processes = []

    def hold(folder):
        folder.mkdir(exist_ok=True)
        command = [sys.executable, "-c", HOLD, folder / LOCK]
        processes.append(subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE))
        processes[-1].stdout.readline()
        return processes[-1]

    yield hold
    for process in processes:
        process.kill()
        process.communicate()


def test_a_folder_in_which_another_process_trains_is_refused(run, refused, tiny, tmp_path, hold):
    holder = hold(tmp_path / "r")
    assert "r is in use by another process" in refused("train", *options(tiny, "r"))
    assert [path.name for path in (tmp_path / "r").iterdir()] == [LOCK]
    holder.kill()
    holder.wait()
    assert run("train", *options(tiny, "r", missions=1, method="mappo"))[0] == 0
    hold(tmp_path / "r")
    before = {path: path.read_bytes() for path in (tmp_path / "r").iterdir()}
    for more in ([], ["--missions", 99]):
        assert "r is in use by another process" in refused("train", "--resume", "--out", "r", *more)
    assert before == {path: path.read_bytes() for path in (tmp_path / "r").iterdir()}


def test_minutes_stop_a_run_early(run, tiny, tmp_path):
    assert run("train", *options(tiny, "r", minutes=0.0001, missions=10**6))[0] == 0
    assert train.Training.resume(tmp_path / "r").updates == 1
    code, out, _ = run("train", "--resume", "--out", "r", "--minutes", 0.0001)
    assert code == 0 and "nothing was left to do: more --minutes" in out


def test_a_run_is_not_overwritten(run, refused, tiny, tmp_path):
    assert run("train", *options(tiny, "r", missions=1))[0] == 0
    before = (tmp_path / "r" / "state.pt").read_bytes()
    assert "--resume" in refused("train", *options(tiny, "r"))
    assert (tmp_path / "r" / "state.pt").read_bytes() == before


BAD = {
    "method": ("nonsense", "nonsense"),
    "scenario": ("nowhere", "nowhere"),
    "links": ("nonsense", "nonsense"),
    "seed": (-1, "seed"),
    "missions": (0, "--missions"),
    "side-by-side": (0, "--side-by-side"),
    "init": ("nowhere.safetensors", "nowhere.safetensors"),
    "workers": (0, "--workers"),
    "lam": ("nan", "--lam"),
    "device": ("cuda", "no CUDA device"),
}


@pytest.mark.parametrize("name", BAD)
def test_train_refuses_bad_options_and_leaves_nothing(refused, tiny, tmp_path, monkeypatch, name):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    value, word = BAD[name]
    assert word in refused("train", *options(tiny, "r", **{name: value}))
    assert not (tmp_path / "r").exists()


def test_every_worker_has_a_mission(refused, tiny, tmp_path):
    assert "--side-by-side must be at least 7" in refused("train", *options(tiny, "r", workers=7))
    assert not (tmp_path / "r").exists()


def test_options_of_learning_are_the_plans_own(run, tiny, tmp_path):
    assert run("train", *options(tiny, "r", missions=1, lam=0.99, trace="second", **{"side-by-side": 5}))[0] == 0
    plan = train.Training.resume(tmp_path / "r").plan
    assert (plan.hyper.lam, plan.hyper.trace, plan.side_by_side) == (0.99, "second", 5)
    hyper, plain = ppo.Hyper(), Train(tmp_path)
    assert (plain.lam, plain.trace) == (hyper.lam, hyper.trace)


@pytest.mark.slow
def test_workers_train_together_and_resume(run, tiny, tmp_path):
    assert run("train", *options(tiny, "r", missions=8, workers=2))[0] == 0
    state = torch.load(tmp_path / "r" / "state.pt", weights_only=True)
    flown = [len(worker["collector"]["scores"]) for worker in state["workers"]]
    assert len(flown) == 2 and min(flown) > 0 and state["counts"][1] == sum(flown) >= 8
    before = (tmp_path / "r" / "state.pt").read_bytes()
    code, out, _ = run("train", "--out", "r", "--resume")
    assert code == 0 and "weights.safetensors after" in out and (tmp_path / "r" / "state.pt").read_bytes() == before


@pytest.mark.parametrize("minutes", [0, -1, "nan"])
def test_train_refuses_no_time_at_all(refused, tiny, tmp_path, minutes):
    assert "--minutes" in refused("train", *options(tiny, "r", minutes=minutes))
    assert not (tmp_path / "r").exists()


def test_tensorboard_is_insisted_on(run, refused, tiny, tmp_path, scalars):
    assert run("train", *options(tiny, "r", missions=1), "--tensorboard")[0] == 0
    assert ("update", 1, 1) in scalars
    sys.modules["torch.utils.tensorboard"] = None  # `scalars` puts back what was there
    assert "commhg_mj[tensorboard]" in refused("train", *options(tiny, "s"), "--tensorboard")
    assert not (tmp_path / "s").exists()


def test_train_refuses_to_resume_nothing_and_a_damaged_run(run, refused, tiny, tmp_path):
    assert "r/plan.json: there is no run" in refused("train", "--out", "r", "--resume")
    assert run("train", *options(tiny, "r", missions=1))[0] == 0
    for name in ("state.pt", "plan.json"):
        (tmp_path / "r" / name).write_bytes(b"[]")
        assert f"r/{name} is damaged" in refused("train", "--out", "r", "--resume")


def test_stages_are_all_smaller_scenarios_in_order(tmp_path):
    large = Plan("commhg", SCENARIOS["large"], init=curriculum.SMALL_TO_LARGE)
    found = curriculum.stages(large, tmp_path)
    assert [plan.scenario.name for plan, _ in found] == ["small", "medium", "large"]
    assert [folder for _, folder in found] == [tmp_path / "small", tmp_path / "medium", tmp_path]
    inits = [str(tmp_path / name / train.WEIGHTS) for name in ("small", "medium")]
    assert [plan.init for plan, _ in found] == ["", *inits]
    assert [plan.hyper.entropy > 0 for plan, _ in found[:2]] == [True, False], "weights to begin with are refined"
    assert found[2][0].hyper == large.hyper
    small = Plan("commhg", SCENARIOS["small"], init=curriculum.SMALL_TO_LARGE)
    assert [(plan.init, folder) for plan, folder in curriculum.stages(small, tmp_path)] == [("", tmp_path)]
    both = curriculum.stages(replace(small, learner=("clone", "ppo", "rollouts")), tmp_path)
    assert [(plan.learner, folder) for plan, folder in both] == [
        (("clone", "ppo"), tmp_path / "clone-ppo"), (("rollouts",), tmp_path),
    ]  # fmt: skip
    assert both[1][0].init == str(tmp_path / "clone-ppo" / train.WEIGHTS)
    assert curriculum.stages(replace(large, init="x"), tmp_path) == [(replace(large, init="x"), tmp_path)]


def test_a_curriculum_goes_on_in_the_stage_where_it_was_interrupted(run, tiny, tmp_path, monkeypatch):
    monkeypatch.setattr(curriculum, "SCENARIOS", {"small": load_scenario(tiny)})
    monkeypatch.setattr(curriculum, "MISSIONS", {"small": 12})
    larger, update, at = tmp_path / "larger.toml", train.Training.update, []
    larger.write_text(TINY.replace("tiny", "larger") + "n_uav = 4\n")

    def interrupt(training):
        at.append(training.plan.scenario.name)
        if len(at) == 2:
            raise KeyboardInterrupt
        return update(training)

    monkeypatch.setattr(train.Training, "update", interrupt)
    assert run("train", *options(larger, "c", init="small-to-large"))[0] == 130
    assert run("train", "--out", "c", "--resume")[0] == 0
    assert at[:2] == ["tiny", "tiny"] and at[-1] == "larger" and sorted(at, key=("tiny", "larger").index) == at
    before, after = (load_weights(folder / train.WEIGHTS)[1] for folder in (tmp_path / "c" / "small", tmp_path / "c"))
    assert after["cpu_seconds_before"] == pytest.approx(before["cpu_seconds"], abs=1) and before["missions"] >= 12


def test_numbers_that_are_none_end_in_one_line(refused, tiny, tmp_path, monkeypatch):
    def update(learner, *arguments):
        return {"policy_loss": float("nan")}

    monkeypatch.setattr(ppo.Learner, "update", update)
    line = refused("train", *options(tiny, "r"))
    assert "update 1: policy_loss is nan" in line and "r keeps" in line
    assert train.Training.resume(tmp_path / "r").updates == 0


def test_the_smallest_scenario_begins_from_nothing(run, tiny, tmp_path):
    assert run("train", *options(tiny, "r", missions=1, init="small-to-large"))[0] == 0
    plan = train.Training.resume(tmp_path / "r").plan
    assert plan.init == "" and plan.hyper.entropy == QUICK.entropy


def start(*arguments, before=()):
    main = "import sys; from commhg_mj_main import main; sys.exit(main())"
    command = [*before, sys.executable, "-c", main, "train", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_of_two_that_begin_in_one_folder_at_once_one_trains(tiny, tmp_path, workers):
    folder = tmp_path / "r"
    arguments = options(tiny, folder, missions=10**6, workers=workers)
    both = [start(*arguments, "--seed", seed) for seed in (0, 1)]
    while not (folder / train.STATE).exists() or all(process.poll() is None for process in both):
        time.sleep(0.1)
    winner, loser = sorted(both, key=lambda process: process.poll() is not None)
    third = start("--resume", "--out", folder)
    for process in (loser, third):
        out, err = process.communicate(timeout=60)
        assert (process.returncode, out, err) == (2, "", f"commhg-mj: {folder} is in use by another process\n")
    assert winner.poll() is None
    winner.kill()
    winner.communicate()
    assert train.Training.resume(folder, ProcessGroup(0, workers)).plan.seed == both.index(winner)
    with held(folder):
        pass


@pytest.mark.slow
def test_without_a_loopback_device(tiny, tmp_path):
    apart = ["unshare", "-rn"]
    if subprocess.run([*apart, "true"], capture_output=True).returncode:
        pytest.skip("no network namespace is to be had")
    out, err = start(*options(tiny, tmp_path / "r", workers=2), before=apart).communicate(timeout=60)
    assert out == "" and err.startswith("commhg-mj: workers cannot meet over the network device lo (") and err.count("\n") == 1


@pytest.mark.slow
@pytest.mark.parametrize("workers, until", [(1, train.STATE), (2, train.STATE), (2, curriculum.PLAN)])
def test_control_c_leaves_a_run_to_resume(tiny, tmp_path, workers, until):
    """A terminal interrupts all processes of a run, whether they have met already or not."""
    process = start(*options(tiny, tmp_path / "r", missions=10**6, workers=workers))
    while not (tmp_path / "r" / until).exists() and process.poll() is None:
        time.sleep(0.1)
    time.sleep(0.5)  # the second process has been started
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (130, "") and err.count("\n") == 1 and f"--resume --out {tmp_path}/r" in err
    assert (tmp_path / "r" / until).exists()


def test_evaluate_refuses_bad_options(refused, tmp_path):
    (tmp_path / "bad.safetensors").write_bytes(b"nonsense")
    assert "bad.safetensors" in refused("evaluate", "--policy", "bad.safetensors")
    assert "nonsense" in refused("evaluate", "--policy", "greedy", "nonsense")
    for option in ("--policy", "--scenario", "--links", "--limitation"):
        assert option in refused("evaluate", option)
    assert "wire" in refused("evaluate", "--links", "abstract", "wire")
    assert "--missions" in refused("evaluate", "--missions", 1)
    assert "--workers" in refused("evaluate", "--workers", 0)
    assert "nowhere" in refused("evaluate", "--scenario", "nowhere")


def test_a_seed_whose_missions_have_none_is_refused_before_anything_is_written(tiny, tmp_path, refused):
    for seed in (1796000000123456789, -1):
        for workers in (1, 2):
            line = refused("train", *options(tiny, "r", missions=1, seed=seed, workers=workers))
            assert f"seed of a training must be a whole number in 0..9223372036852, is {seed}" in line
    assert not (tmp_path / "r").exists()


def test_evaluation_and_training_share_no_mission():
    from commhg_mj.flights.held_out import HELD_OUT

    assert HELD_OUT + 10**5 < train.TRAINING_SEEDS


@pytest.mark.parametrize("method", ["commhg", "mappo"])
def test_publish_writes_weights_and_a_card_of_what_they_do(run, tiny, tmp_path, method):
    assert run("train", *options(tiny, "r", missions=1, method=method))[0] == 0
    flight = "--missions", 4, "--workers", 1
    assert run("publish", "r", "--out", "p", *flight)[0] == 0
    files = sorted(path.name for path in (tmp_path / "p").iterdir())
    assert files == [f"{method}-tiny.md", f"{method}-tiny.safetensors"]
    weights = tmp_path / "r" / train.WEIGHTS
    (mine, facts), (theirs, published) = load_weights(weights), load_weights(tmp_path / "p" / files[1])
    assert facts == published and (tmp_path / "p" / files[1]).stat().st_size < 0.9 * weights.stat().st_size
    kept = [name for name, tensor in mine.state_dict().items() if torch.equal(tensor, theirs.state_dict()[name])]
    assert {name.partition(".")[0] for name in kept} >= {"robot", "operator"}
    assert not any(name.startswith("critic.") for name in names_in(tmp_path / "p" / files[1]))
    card = (tmp_path / "p" / files[0]).read_text()
    assert run("evaluate", "--policy", "greedy", weights, "--scenario", tiny, *flight, "--out", "e.json")[0] == 0
    twcr = [np.array(column) for column in json.loads((tmp_path / "e.json").read_text())["conditions"][0]["twcr"].values()]
    row = f"| {method} | {mean_interval(twcr[1])} | {middle_interval(twcr[1])} | {mean_interval(twcr[1] - twcr[0])} |"
    assert row in card and f"| {method}+drawn |" in card and '"missions": 1' in card
    assert (f"| {method}+random-gates |" in card) == (method == "commhg")


def names_in(path):
    with safe_open(path, "pt") as file:
        return list(file.keys())


def test_learners_one_after_the_other_each_in_a_folder_of_its_own(run, tiny, tmp_path):
    words = options(tiny, "r", missions=6, method="mappo", learner="clone,rollouts,ppo", teacher="planner")
    assert run("train", *words, "--plans")[0] == 0
    learned = [load_weights(tmp_path / name / train.WEIGHTS) for name in ("r/clone", "r/rollouts", "r")]
    (_, cloned), (_, improved), (method, refined) = learned
    assert [facts["plan"]["learner"] for _, facts in learned] == [["clone"], ["rollouts"], ["ppo"]]
    assert [facts["learners"] for _, facts in learned] == [["clone"], ["clone", "rollouts"], ["clone", "rollouts", "ppo"]]
    assert improved["cpu_seconds_before"] == cloned["cpu_seconds"] and method.plan.bounds == 1
    assert refined["cpu_seconds_before"] == improved["cpu_seconds_before"] + improved["cpu_seconds"]
    assert cloned["plan"]["hyper"]["entropy"] > 0 == refined["plan"]["hyper"]["entropy"], "what was learned is not undone"
    before = (tmp_path / "r" / train.WEIGHTS).read_bytes()
    code, out, _ = run("train", "--resume", "--out", "r")
    assert code == 0 and "nothing was left to do" in out and (tmp_path / "r" / train.WEIGHTS).read_bytes() == before
    assert run("publish", "r", "--out", "p", "--missions", 2, "--workers", 1)[0] == 0
    assert names_in(tmp_path / "p/mappo-rollouts-tiny.safetensors")
    assert "Learned by clone, then rollouts, then ppo: " in (tmp_path / "p/mappo-rollouts-tiny.md").read_text()
    assert run("evaluate", "--policy", "r/weights.safetensors+drawn", "--scenario", tiny, "--missions", 2, "--workers", 1)[0] == 0
    assert "was trained with --plans" in run("train", *options(tiny, "s", method="mappo", init="r/weights.safetensors"))[2]


@pytest.mark.parametrize(
    "words, said",
    [
        (("--learner", "sgd"), "unknown learner 'sgd': use clone, ppo, rollouts"),
        (("--learner", "ppo,clone"), "learner: clone comes first, not in ppo,clone"),
        (("--learner", ""), "unknown learner ''"),
        (("--method", "informarl", "--plans"), "plans: informarl never reads the planner's numbers"),
    ],
)
def test_impossible_learners_are_refused_before_anything_is_written(refused, tiny, tmp_path, words, said):
    assert said in refused("train", *options(tiny, "r"), *words)
    assert not (tmp_path / "r").exists()


def test_publish_refuses_what_says_nothing_of_its_training(run, refused, tmp_path):
    assert "nowhere" in refused("publish", "nowhere", "--out", "p")
    save_weights(find_method("mappo")(), tmp_path / "bare.safetensors", {})
    assert "bare.safetensors says nothing of its training" in refused("publish", "bare.safetensors", "--out", "p")
    assert not (tmp_path / "p").exists()
