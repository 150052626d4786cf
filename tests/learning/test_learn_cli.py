"""`commhg-mj train` and `commhg-mj evaluate`."""

import json
from functools import partial

import numpy as np
import pytest
import torch
from learners import NAMES, QUICK

from commhg_mj.learning import ppo, train
from commhg_mj.policies import POLICIES, ensure_compiled

TINY = 'base = "small"\nname = "tiny"\nn_tasks = 4\ntime_limit = 40\n'


@pytest.fixture(scope="module", autouse=True)
def quick():
    """A few decisions an update."""
    ensure_compiled(POLICIES.values())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ppo, "Hyper", partial(ppo.Hyper, decisions=QUICK.decisions, minibatches=2, epochs=1))
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


@pytest.mark.parametrize("method", NAMES)
def test_train_then_evaluate(run, tiny, tmp_path, method):
    code, out, err = run("train", *options(tiny, "r", method=method, missions=4))
    assert code == 0 and "weights.safetensors after" in out and "update    1" in err and "TWCR" in err
    assert sorted(path.name for path in (tmp_path / "r").iterdir()) == ["log.csv", "state.pt", "weights.safetensors"]
    weights = "r/weights.safetensors"
    code, out, err = run(
        "evaluate", "--policy", "greedy", weights, "--scenario", tiny, "--missions", 4, "--workers", 1, "--out", "e.json"
    )  # fmt: skip
    assert code == 0 and "held-out" in out and "minus greedy" in out
    assert any(line.split()[:1] == ["r"] for line in out.replace("│", " ").splitlines()), "weights go by their run's name"
    stored = json.loads((tmp_path / "e.json").read_text())
    assert set(stored["twcr"]) == {"greedy", weights} and all(len(column) == 4 for column in stored["twcr"].values())
    assert all(np.isfinite(column).all() for column in stored["twcr"].values())


def test_resume_goes_on_where_an_interrupted_run_stood(run, tiny, tmp_path, monkeypatch):
    update = train.Training.update

    def interrupt(training):
        if training.updates == 2:
            raise KeyboardInterrupt
        return update(training)

    monkeypatch.setattr(train.Training, "update", interrupt)
    assert run("train", *options(tiny, "r"))[0] == 130
    monkeypatch.setattr(train.Training, "update", update)
    assert train.Training.resume(tmp_path / "r").updates == 2
    assert run("train", "--out", "r", "--resume")[0] == 0
    assert run("train", *options(tiny, "whole"))[0] == 0
    one, other = (torch.load(tmp_path / name / "state.pt", weights_only=True) for name in ("r", "whole"))
    assert all(torch.equal(one["method"][key], other["method"][key]) for key in one["method"])
    assert one["counts"][:2] == other["counts"][:2] and one["counts"][0] > 2
    updates = [line.split(",")[0] for line in (tmp_path / "r" / "log.csv").read_text().splitlines()]
    assert updates == ["update", *map(str, range(1, one["counts"][0] + 1))]
    # A run that is done stays as it is.
    before = (tmp_path / "r" / "state.pt").read_bytes()
    assert run("train", "--out", "r", "--resume")[0] == 0
    assert (tmp_path / "r" / "state.pt").read_bytes() == before


def test_minutes_stop_a_run_early(run, tiny, tmp_path):
    assert run("train", *options(tiny, "r", minutes=0.0001, missions=10**6))[0] == 0
    assert train.Training.resume(tmp_path / "r").updates == 1


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
}


@pytest.mark.parametrize("name", BAD)
def test_train_refuses_bad_options(refused, tiny, name):
    value, word = BAD[name]
    assert word in refused("train", *options(tiny, "r", **{name: value}))


@pytest.mark.xfail(strict=True, reason="--minutes is not checked: the weights that are named are not there")
@pytest.mark.parametrize("minutes", [0, -1, "nan"])
def test_train_refuses_no_time_at_all(refused, tiny, minutes):
    assert "--minutes" in refused("train", *options(tiny, "r", minutes=minutes))


def test_train_refuses_to_resume_nothing_and_a_damaged_state(refused, tmp_path):
    assert "r/state.pt" in refused("train", "--out", "r", "--resume")
    (tmp_path / "r").mkdir()
    (tmp_path / "r" / "state.pt").write_bytes(b"")
    assert "r/state.pt" in refused("train", "--out", "r", "--resume")


@pytest.mark.xfail(strict=True, raises=FloatingPointError, reason="cli.main does not catch FloatingPointError")
def test_numbers_that_are_none_end_in_one_line(refused, tiny, monkeypatch):
    def update(learner, *arguments):
        return {"policy_loss": float("nan")}

    monkeypatch.setattr(ppo.Learner, "update", update)
    code_and_line = refused("train", *options(tiny, "r"))
    assert "update 0" in code_and_line


def test_evaluate_refuses_bad_options(refused, tmp_path):
    (tmp_path / "bad.safetensors").write_bytes(b"nonsense")
    assert "bad.safetensors" in refused("evaluate", "--policy", "bad.safetensors")
    assert "nonsense" in refused("evaluate", "--policy", "greedy", "nonsense")
    assert "--missions" in refused("evaluate", "--missions", 1)
    assert "--workers" in refused("evaluate", "--workers", 0)
    assert "nowhere" in refused("evaluate", "--scenario", "nowhere")


def test_evaluation_and_training_share_no_mission():
    from commhg_mj.study.evaluate import HELD_OUT

    assert HELD_OUT + 10**5 < train.TRAINING_SEEDS
