"""Try fresh environments as a user makes them, by the Makefile: other Pythons, lowest versions, MuJoCo 4.

python scripts/environments.py matrix    every Python found: `make demo`, then a step of each interface
python scripts/environments.py lowest    every requirement at its lowest declared version: same bits, tests of the rooms
python scripts/environments.py mujoco4   MuJoCo 4: tests of the rooms, but for the dm_control face

`--rooms models radio` names the rooms of tests/ that are run. Each environment is a copy of this repository in a temporary
folder, which is removed. Where pip would load torch as a build of several gigabytes, since none lies in a local folder, a
hollow one is installed in its place: the simulator, its pictures and its interfaces need none. It needs a network, and some
minutes an environment.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from zipfile import ZipFile

ROOT = Path(__file__).parent.parent
REFUSED, PYTHONS = "3.10", ("3.11", "3.12", "3.13", "3.14")
ROOMS = ["models", "radio", "mission", "render", "tasks", "policies"]  # none of their tests needs torch
NOT_COPIED = ".git", ".venv", "runs", "build", "__pycache__", "*.egg-info", ".*_cache", ".hypothesis", ".demo"
NOT_DM_CONTROL = (  # files and tests that step its environments
    "not dm_control and not test_suite and not test_physics and not test_sharing and not test_identity"
    " and not impossible_discounts and not keywords_of_load and not seeds_of_a_task"
)
FACES = """
import commhg_mj, gymnasium
env = commhg_mj.tasks.load("surveillance", "small")
env.reset(), env.step(env.action_spec().minimum)
env = gymnasium.make("commhg_mj/Surveillance-small-v0")
env.reset(seed=1), env.step(env.action_space.sample() * 0)
env = commhg_mj.tasks.parallel_env("small")
env.reset(seed=1), env.step({agent: env.action_space(agent).sample() * 0 for agent in env.agents})
"""


def pins() -> dict[str, str]:
    """{package: version} of constraints.txt."""
    return dict(re.findall(r"^([\w.-]+)==(\S+)", (ROOT / "constraints.txt").read_text(encoding="utf-8"), re.M))


def lower_bounds() -> dict[str, str]:
    """{package: lowest version} that pyproject.toml declares."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    requirements = project["dependencies"] + sum(project["optional-dependencies"].values(), [])
    return dict(re.findall(r"^([\w.-]+)>=([\w.]+)", "\n".join(requirements), re.M))


def find_pythons() -> dict[str, str]:
    """{"3.11": interpreter} of pyenv, else of PATH; a shim of pyenv may have nothing behind it."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    found = {}
    for version in (REFUSED, *PYTHONS):
        for path in [*pyenv.glob(f"versions/{version}.*/bin/python"), shutil.which(f"python{version}")]:
            if path and version not in found and not subprocess.run([path, "-V"], capture_output=True).returncode:
                found[version] = str(path)
    return found


def torch_lies_here(python) -> bool:
    """Whether pip finds the pinned torch in a local folder; asked without the index, from where pip would load it whole."""
    asked = ["install", "--dry-run", "--no-index", "--no-deps", "--ignore-installed", f"torch=={pins()['torch']}"]
    return not subprocess.run([python, "-m", "pip", *asked], capture_output=True).returncode


def without_wheel(version) -> list[str]:
    """Pins that are not to be had as wheels for a Python that need not be here."""
    wanted = ["--only-binary", ":all:", "--python-version", version]

    def has_wheel(pin):
        said = subprocess.run([sys.executable, "-m", "pip", "index", "versions", pin[0], *wanted], capture_output=True, text=True)
        return pin[1] in re.findall(r"[^\s,()]+", said.stdout)

    with ThreadPoolExecutor(4) as threads:
        return [name for name, is_there in zip(pins(), threads.map(has_wheel, pins().items())) if not is_there]


class Environment:
    """A copy of the repository that is made and tried by its Makefile."""

    def __init__(self, folder, python):
        self.folder = Path(folder, "copy")
        shutil.copytree(ROOT, self.folder, ignore=shutil.ignore_patterns(*NOT_COPIED))
        self.python, self.has_torch = python, torch_lies_here(python)
        links = os.environ.get("PIP_FIND_LINKS", "")
        self.variables = {**os.environ, "NUMBA_CACHE_DIR": f"{folder}/kernels", "PIP_FIND_LINKS": links}
        self.variables.pop("PYTHONPATH", None)
        if not self.has_torch:
            self.variables["PIP_FIND_LINKS"] = f"{links} {hollow_torch(folder)}"

    def call(self, *command) -> subprocess.CompletedProcess:
        return subprocess.run(command, cwd=self.folder, env=self.variables, capture_output=True, text=True)

    def make(self, target) -> str:
        """Make a target; what went wrong in one line, or nothing."""
        done = self.call("make", target, f"PYTHON={self.python}")
        said = [line for line in done.stderr.splitlines() if not line.startswith("make: ")]
        return (said or ["failed"])[-1] if done.returncode else ""

    def run(self, *arguments) -> subprocess.CompletedProcess:
        return self.call(".venv/bin/python", *arguments)

    def test(self, rooms, *options) -> str:
        """pytest's last line, and what failed."""
        tests = [f"tests/{room}" for room in rooms]
        said = self.run("-m", "pytest", "-q", "-n", "1", *tests, *options).stdout.splitlines()
        return "\n  ".join([said[-1], *(line for line in said if line.startswith(("FAILED", "ERROR")))])


def hollow_torch(folder) -> Path:
    """A folder with a wheel that is called torch and holds nothing; pip takes its version for the pinned one's latest build."""
    version, place = f"{pins()['torch']}+hollow", Path(folder, "wheels")
    place.mkdir()
    with ZipFile(place / f"torch-{version}-py3-none-any.whl", "w") as wheel:
        wheel.writestr(f"torch-{version}.dist-info/METADATA", f"Metadata-Version: 2.1\nName: torch\nVersion: {version}\n")
        wheel.writestr(f"torch-{version}.dist-info/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        wheel.writestr(f"torch-{version}.dist-info/RECORD", "")
    return place


def matrix(folder, rooms) -> bool:
    """A line for each Python that is promised, and for one that is refused."""
    found, is_good = find_pythons(), True
    for version in PYTHONS:
        if version not in found:
            missing = ", ".join(without_wheel(version)) or "none"
            print(f"{version} | not on this machine | pins without a wheel for it: {missing}")
    for version, python in found.items():
        with tempfile.TemporaryDirectory(dir=folder) as place:
            is_good &= try_python(version, Environment(place, python), rooms)
    return is_good


def try_python(version, environment, rooms) -> bool:
    start = time.perf_counter()
    failure = environment.make("demo")
    cells = [version, failure or f"make demo: {time.perf_counter() - start:.0f} s"]
    if not failure:
        cells.append("torch: pinned" if environment.has_torch else "torch: left out, none lies in a local folder")
        stepped = environment.run("-c", FACES)
        failure = (stepped.stderr.splitlines() or ["failed"])[-1] if stepped.returncode else ""
        cells.append(failure or "dm_control, Gymnasium, PettingZoo: step")
    if rooms and not failure:
        cells.append(environment.make(".venv/.tested") or environment.test(rooms))
        failure = "passed" not in cells[-1] or "failed" in cells[-1]
    print(" | ".join(cells), flush=True)
    return bool(failure) == (version == REFUSED)


def lowest(folder, rooms) -> bool:
    """The lowest versions together, the other packages as pip finds them."""
    environment = Environment(folder, find_pythons()[PYTHONS[0]])
    bounds = lower_bounds()
    print(", ".join(f"{name} {bound}" for name, bound in bounds.items()))
    print("torch's bound is the lowest that is to be had without CUDA here")
    (environment.folder / "constraints.txt").write_text("".join(f"{name}=={bound}\n" for name, bound in bounds.items()))
    failure = environment.make(".venv/.tested")
    if failure:
        print(failure)
        return False
    found = environment.run("tests/fingerprints.py").stdout
    of_the_pins = (environment.folder / "tests/fingerprints.json").read_text(encoding="utf-8")
    is_same = found and json.loads(found) == json.loads(of_the_pins)
    print(f"fingerprints of worlds, links and missions: {'those of the pins' if is_same else 'others'}")
    return report(environment, rooms) and is_same


def mujoco4(folder, rooms) -> bool:
    """MuJoCo 4, which pyproject.toml keeps out for the sake of dm_control alone."""
    environment = Environment(folder, find_pythons()[PYTHONS[0]])
    for name, old, new in [("pyproject.toml", r'"mujoco>=[^"]*"', '"mujoco>=4,<5"'), ("constraints.txt", r"\nmujoco==.*", "")]:
        path = environment.folder / name
        path.write_text(re.sub(old, new, path.read_text(encoding="utf-8")))
    failure = environment.make(".venv/.tested")
    print(failure or environment.run("-c", "import mujoco; print('mujoco', mujoco.__version__)").stdout.strip())
    return not failure and report(environment, rooms, "-k", NOT_DM_CONTROL)


def report(environment, rooms, *options) -> bool:
    said = environment.test(rooms, *options)
    print(said)
    return "passed" in said and "failed" not in said and "error" not in said


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", choices=["matrix", "lowest", "mujoco4"])
    parser.add_argument("--rooms", nargs="*", metavar="ROOM", help=f"default: none of matrix, else {' '.join(ROOMS)}")
    given = parser.parse_args()
    rooms = given.rooms if given.rooms is not None else [] if given.command == "matrix" else ROOMS
    with tempfile.TemporaryDirectory() as folder:
        sys.exit(not {"matrix": matrix, "lowest": lowest, "mujoco4": mujoco4}[given.command](folder, rooms))
