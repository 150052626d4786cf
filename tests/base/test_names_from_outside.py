"""Names from outside: decorators in this process, entry points of packages in every one."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import commhg_mj
from commhg_mj.base.registries import Registry
from commhg_mj.flights.fly import fly
from commhg_mj.policies import find_policy, label_of

ROOT = Path(commhg_mj.__file__).parents[1]
PACKAGE = '''
import commhg_mj
from torch import nn

SCENARIO = commhg_mj.SCENARIOS["small"]
SCENARIO = type(SCENARIO)(**{**vars(SCENARIO), "name": "brought", "time_limit": 40})

class Still:
    def __init__(self, batch): pass
    def __call__(self, observations): return commhg_mj.stay(observations)

def half(a, b, size, link):
    return 0.5

class Method(nn.Module):
    communicates = False
'''
ENTRY_POINTS = """
[commhg_mj.scenarios]
brought = brought:SCENARIO
toml = brought:TOML
[commhg_mj.policies]
still = brought:Still
broken = brought:missing
[commhg_mj.link_models]
half = brought:half
[commhg_mj.methods]
third = brought:Method
"""


@pytest.fixture
def package(tmp_path):
    """A folder that holds an installed package with entry points."""
    (tmp_path / "brought.py").write_text(PACKAGE + f"\nTOML = {str(tmp_path / 'quick.toml')!r}\n")
    (tmp_path / "quick.toml").write_text('base = "small"\nname = "quick"\ntime_limit = 30\n')
    folder = tmp_path / "brought-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: brought\nVersion: 1.0\n")
    (folder / "entry_points.txt").write_text(ENTRY_POINTS)
    return tmp_path


def python(code, *folders):
    program = f"import sys; sys.path[:0] = {list(map(str, folders))!r}\n{code}"
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)


def test_entry_points_bring_scenarios_policies_link_models_and_methods(package):
    code = """
import commhg_mj
from commhg_mj.cli import main
from commhg_mj.learning.registry import find_method
from commhg_mj.flights.fly import fly
scores = fly(commhg_mj.load_scenario("brought"), "still", [1, 2], links="half")
print([score.twcr for score in scores], commhg_mj.load_scenario("toml").name, find_method("third").name)
for arguments in ("scenarios none", "run --policy broken"):
    print(main(arguments.split()))
"""
    done = python(code, package, ROOT)
    assert done.stdout.splitlines()[-3:] == ["[0.0, 0.0] quick third", "2", "2"], done.stderr
    refused = done.stderr.splitlines()[-2:]
    assert "use small, medium, large, brought, toml or a .toml file" in done.stderr
    assert "policy 'broken' of brought:missing" in refused[-1]


def test_a_decorated_policy_flies_by_its_name():
    @commhg_mj.policy("test-still")
    class Still:
        def __init__(self, batch):
            self.n = len(batch.seeds)

        def __call__(self, observations):
            return commhg_mj.stay(observations)

    try:
        assert find_policy("test-still").make is Still and label_of("test-still") == "test-still"
        assert not find_policy("test-still").is_privileged
        scores = fly(commhg_mj.SCENARIOS["small"], "test-still", [3])
        assert np.isfinite(scores[0].twcr)
    finally:
        del commhg_mj.POLICIES["test-still"]
    with pytest.raises(ValueError, match="unknown policy .test-still.: use random, greedy, greedy.no-query, cbba, planner, omni"):
        find_policy("test-still")


@pytest.mark.parametrize("name", ["greedy", "", 3, None])
def test_a_policys_name_is_a_new_word(name):
    with pytest.raises(ValueError, match="policy .*name"):
        commhg_mj.policy(name)


def test_a_registry_names_what_it_has():
    letters = Registry("letter", "commhg_mj.nothing", {"a": 1}, beside=["z"])
    assert letters.find("a") == 1 and letters.names() == ["z", "a"]
    for name in ("b", 3, None, ["a"]):
        with pytest.raises(ValueError, match="unknown letter .*: use z, a or another"):
            letters.find(name, " or another")
