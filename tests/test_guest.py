"""In somebody's process we are a guest: nothing of ours moves the global state of their libraries."""

import json
import subprocess
import sys
from pathlib import Path

import commhg_mj
from commhg_mj.learning.registry import find_method
from commhg_mj.learning.weights import save_weights

ROOT = Path(commhg_mj.__file__).parents[1]
STATE = """
import hashlib, json, random, signal, sys
sys.path.insert(0, {root!r})
import matplotlib, numpy, torch
torch.set_num_threads(2)

def state():
    parts = torch.get_rng_state().numpy().tobytes(), repr(numpy.random.get_state()).encode(), repr(random.getstate()).encode()
    return {{
        "torch": [torch.get_num_threads(), torch.get_default_dtype().is_floating_point, torch.is_grad_enabled()],
        "draws": [hashlib.sha256(part).hexdigest() for part in parts],
        "matplotlib": hashlib.sha256(repr(sorted(matplotlib.rcParams.items())).encode()).hexdigest(),
        "numpy": [sorted(numpy.geterr().items()), numpy.get_printoptions()["precision"]],
        "signals": [repr(signal.getsignal(number)) for number in (signal.SIGINT, signal.SIGTERM)],
    }}

moved = {{}}
before = state()
import commhg_mj
for entry, code in {entries!r}.items():
    exec(code)
    after = state()
    moved[entry] = [name for name in before if before[name] != after[name]]
print(json.dumps(moved))
"""
ENTRIES = {
    "import": "import commhg_mj.tasks",
    "a learned policy": """
from commhg_mj.policies import prepare
batch, policy = prepare("WEIGHTS", "small", [1])
batch.step(policy(batch.observations))
""",
    "a figure": """
from commhg_mj.base.charts import save_figure
from commhg_mj.planning.coverage import cover, coverage_figure
from commhg_mj.planning.endpoints import parse_endpoint
import commhg_mj.planning.coverage as coverage, tempfile
coverage.CELLS = 8
scenario = commhg_mj.load_scenario("small")
figure = coverage_figure(cover(commhg_mj.make_world(scenario, 0), parse_endpoint("station", scenario, "from"), 1.5))
save_figure(figure, tempfile.mkdtemp() + "/a.png")
""",
    "environments": """
import gymnasium
env = gymnasium.make("commhg_mj/Surveillance-small-v0")
env.reset(seed=1), env.step(env.action_space.sample() * 0)
commhg_mj.tasks.parallel_env("small").reset(seed=1)
""",
}


def test_global_state_stays(tmp_path):
    weights = str(tmp_path / "weights.safetensors")
    save_weights(find_method("commhg")(), weights, {})
    entries = {entry: code.replace("WEIGHTS", weights) for entry, code in ENTRIES.items()}
    code = STATE.format(root=str(ROOT), entries=entries)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout.splitlines()[-1]) == {entry: [] for entry in ENTRIES}
