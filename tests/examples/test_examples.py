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


def test_maskable_ppo_of_sb3_contrib(tmp_path):
    pytest.importorskip("sb3_contrib")
    said = run("examples/maskable_ppo.py", "--tiny", "--out", tmp_path / "model.zip")
    lines = [rf"{who}: TWCR 0\.\d{{3}} \+- 0\.\d{{3}}\n" for who in ("stay", "random", "untrained", "trained")]
    assert re.fullmatch("".join(lines), said)
    assert (tmp_path / "model.zip").exists()


def test_the_viewers_loop_without_a_window(tmp_path):
    said = run("examples/viewer_headless.py", "--frames", 330, "--width", 320, "--height", 180, "--out", tmp_path / "viewer.png")
    assert re.match(r"1 episodes ended, \d+ s into the next; .*viewer\.png: 320x180\n", said)
    picture = cv2.imread(str(tmp_path / "viewer.png"))
    assert picture.shape == (180, 320, 3) and picture.std() > 10
