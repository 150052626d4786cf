"""The examples run on tiny budgets."""

import re
import subprocess
import sys
from pathlib import Path

import cv2
import pytest

ROOT = Path(__file__).parent.parent.parent


def run(*arguments) -> str:
    """What an example prints."""
    command = [sys.executable, "-W", "ignore", *map(str, arguments)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_maskable_ppo_of_sb3_contrib(tmp_path):
    pytest.importorskip("sb3_contrib")
    said = run("examples/maskable_ppo.py", "--tiny", "--out", tmp_path / "model.zip")
    ways = [f"{when}, {how}" for when in ("untrained", "trained") for how in ("sampled", "likeliest")]
    lines = [rf"{who}: TWCR 0\.\d{{3}} \+- 0\.\d{{3}}\n" for who in ("stay", "random", *ways)]
    assert re.fullmatch("".join(lines), said), said
    assert (tmp_path / "model.zip").exists()


def test_a_policy_by_hand_beats_doing_nothing_and_is_filmed(tmp_path):
    pytest.importorskip("moviepy")
    said = run("examples/own_policy.py", "--tiny", "--video", tmp_path, "--frames", 5)
    own, nothing = map(float, re.fullmatch(r"own_policy: TWCR (\S+) of .*\nnothing: TWCR (\S+) of .*\n.*\.mp4\n", said).groups())
    assert own > nothing + 0.2
    film = cv2.VideoCapture(str(tmp_path / "small-episode-0.mp4"))
    assert film.read()[1].shape == (360, 640, 3)


@pytest.mark.slow
def test_the_viewers_loop_without_a_window(tmp_path):
    said = run("examples/viewer_headless.py", "--frames", 330, "--width", 320, "--height", 180, "--out", tmp_path / "viewer.png")
    assert re.match(r"1 episodes ended, \d+ s into the next; .*viewer\.png: 320x180\n", said)
    picture = cv2.imread(str(tmp_path / "viewer.png"))
    assert picture.shape == (180, 320, 3) and picture.std() > 10


@pytest.mark.slow
def test_mappo_of_torchrl(tmp_path):
    pytest.importorskip("torchrl")
    (tmp_path / "brief.toml").write_text('base = "small"\nname = "brief"\ntime_limit = 20\n')
    said = run("examples/mappo_torchrl.py", "--tiny", "--scenario", tmp_path / "brief.toml")
    assert re.fullmatch("".join(rf"{who}: TWCR 0\.\d{{3}} \+- 0\.\d{{3}}\n" for who in ("trained", "random", "stay")), said)
