"""`explain` and `cases` on the command line."""

import cv2
import pytest

from commhg_mj.base.kernels import ensure_compiled
from commhg_mj.cli import main


@pytest.fixture(scope="module")
def traces(tmp_path_factory):
    """Folder with small-random-19.npz, in which there are cases, and tiny-greedy-0.npz, in which nobody asks."""
    ensure_compiled()
    folder = tmp_path_factory.mktemp("traces")
    tiny = folder / "tiny.toml"
    tiny.write_text('base = "small"\nname = "tiny"\nn_tasks = 4\ntime_limit = 30\n')
    assert main(["run", "--scenario", str(tiny), "--out", str(folder), "--json"]) == 0
    assert main(["run", "--scenario", "small", "--policy", "random", "--seed", "19", "--out", str(folder), "--json"]) == 0
    return folder


def test_explain_prints_tables_and_draws(run, traces, tmp_path):
    code, out, err = run("explain", traces / "tiny-greedy-0.npz", "--robot", "ugv1", "--at", 20)
    assert (code, err) == (0, "")
    for word in ("ugv1 at ", "T3", "KEEP", "IDLE", "operator1", "uav0", "unknown: never heard", "the truth", "chose: "):
        assert word in out, word
    (path,) = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert path.relative_to(tmp_path).as_posix() == "renders/tiny-greedy-0-ugv1-20.png" and f"wrote {path.name}" not in out
    picture = cv2.imread(str(path))
    assert picture.shape[1] > 1500 and picture.std() > 20
    left, right = picture[100:800, :800], picture[100:800, 812:1612]
    assert (left != right).any()


def test_the_privileged_reference_is_marked(run, traces):
    assert run("run", "--scenario", traces / "tiny.toml", "--policy", "omniscient", "--out", ".", "--json")[0] == 0
    out = run("explain", "tiny-omniscient-0.npz", "--robot", "uav0", "--at", 9, "--out", "x.png")[1]
    assert "PRIVILEGED" in out and "preferred" not in out


def test_cases_lists_and_draws_the_best(run, traces, tmp_path):
    code, out, _ = run("cases", *sorted(traces.glob("*.npz")), "--out", "case.png", "--no-clip", "--workers", 1)
    assert code == 0 and "small-random-19" in out and out.endswith("wrote case.png\n")
    assert [path.name for path in tmp_path.iterdir()] == ["case.png"]


def test_no_case_is_no_error(run, traces, tmp_path):
    assert run("cases", traces / "tiny-greedy-0.npz")[:2] == (0, "no case in 1 mission\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("arguments, said", [
    (("explain", "tiny", "--robot", "uav7", "--at", 3), "--robot"),
    (("explain", "tiny", "--robot", "uav0", "--at", 31), "--at 31"),
    (("explain", "tiny", "--robot", "uav0", "--at", 3, "--policy", "random"), "tiny-greedy-0.npz was not flown by random"),
    (("explain", "tiny", "--robot", "uav0", "--at", 3, "--policy", "none.safetensors"), "none.safetensors"),
    (("explain", "tiny", "--robot", "uav0", "--at", 3, "--out", "x.gif"), "--out x.gif"),
    (("explain", "tiny", "--robot", "uav0", "--at", 3, "--out", "no/x.png"), "no/x.png"),
    (("explain", "tiny.toml", "--robot", "uav0", "--at", 3), "tiny.toml"),
    (("cases", "tiny.toml"), "tiny.toml"),
    (("cases", "tiny", "--policy", "nobody"), "unknown policy 'nobody'"),
    (("cases", "tiny", "--out", "x.mp4"), "--out x.mp4"),
    (("cases", "tiny", "--workers", 0), "--workers"),
    (("cases",), "at least one trace file"),
])  # fmt: skip
def test_refused(run, traces, tmp_path, arguments, said):
    names = {"tiny": traces / "tiny-greedy-0.npz", "tiny.toml": traces / "tiny.toml"}
    code, out, err = run(*(names.get(word, word) for word in arguments))
    assert code == 2 and said in err and err.count("\n") == 1 and err.startswith("commhg-mj: ")
    assert out == "" and not list(tmp_path.iterdir())
