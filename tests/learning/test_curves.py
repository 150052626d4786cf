"""`commhg-mj curves` and `commhg-mj methods`: training runs side by side, and what the methods are."""

import pytest
from learners import SHORT, updated
from learners import run as begin
from strategies import change

from commhg_mj.learning.method_table import method_rows
from commhg_mj.learning.train import CLONED, WEIGHTS, Training
from commhg_mj.learning.weights import load_weights
from commhg_mj.study.learning_curves import REFERENCE, study_runs


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Two runs of three updates, of which the first imitates."""
    folders = []
    for name in ("mappo", "ata-hrl"):
        folder = tmp_path_factory.mktemp("runs") / name
        training = begin(folder, name, missions=30)
        for _, row in zip(range(3), training.run()):
            last = row
        folders.append((folder, last))
    return folders


def test_what_imitates_is_kept_beside_what_learned(runs):
    for folder, last in runs:
        (cloned, facts), (final, later) = load_weights(folder / CLONED), load_weights(folder / WEIGHTS)
        assert facts["updates"] == 1 < later["updates"] == last["update"]
        assert any((a != b).any() for a, b in zip(cloned.state_dict().values(), final.state_dict().values()))
        resumed = Training.resume(folder)
        assert not resumed.has_cloned and (folder / CLONED).stat().st_mtime_ns < (folder / WEIGHTS).stat().st_mtime_ns


def test_a_study_pairs_each_run_with_its_imitation_and_the_reference(runs):
    ended = []
    study = study_runs([folder for folder, _ in runs], 4, 1, ended.append)
    assert sum(ended) == 4 * 5 and [run.method for run in study.runs] == ["mappo", "ata-hrl"]
    for one, (_, last) in zip(study.runs, runs):
        assert one.gain.mean == pytest.approx(one.final.mean - one.cloned.mean)
        assert one.margin.mean == pytest.approx(one.final.mean - study.reference.mean)
        assert one.minutes[-1] == pytest.approx(last["cpu_seconds"] / 60) and len(one.minutes) == len(one.training) == 3
        assert one.changes == pytest.approx(last["changes"]) and 0 <= one.changes <= 1


def test_the_command_draws_and_prints(runs, run, tmp_path):
    folders = [folder for folder, _ in runs]
    code, out, err = run("curves", *folders, "--missions", "2", "--workers", "1", "--out", "curves.png")
    assert code == 0 and (tmp_path / "curves.png").read_bytes().startswith(b"\x89PNG")
    assert REFERENCE in out and "mappo" in out and "ata-hrl" in out
    code, out, _ = run("methods")
    assert code == 0 and all(row[0].split("-")[0] in out for row in method_rows())


def test_bad_input_is_one_line(runs, run, tmp_path):
    good = runs[0][0]
    other = tmp_path / "other"
    updated(begin(other, "mappo", change(SHORT, time_limit=41)), 1).save()
    cases = {
        ("curves",): "RUNS: name at least one",
        ("curves", tmp_path / "none"): "none",
        ("curves", good, "--missions", "1"): "missions",
        ("curves", good, "--workers", "0"): "workers",
        ("curves", good, other, "--missions", "2"): f"{other} was trained under other conditions",
        ("curves", good, "--out", tmp_path): str(tmp_path),
    }
    for arguments, word in cases.items():
        code, out, err = run(*arguments)
        assert (code, out) == (2, "") and word in err and err.count("\n") == 1, (arguments, err)
