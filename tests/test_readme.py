"""What README and docs show works as it stands."""

import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import tyro

from commhg_mj import POLICIES, SCENARIOS, Decisions, Observations, cli, load_scenario
from commhg_mj.learning.pretrained import split_variant, trained_methods
from commhg_mj.learning.registry import METHODS
from commhg_mj.mission import observe
from commhg_mj.policies.planner import ABLATIONS
from commhg_mj.policies.talk import split_talk
from commhg_mj.radio.link_models import LINK, OWN_MODELS

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = sorted(page for folder in (".", "docs", "renders", "commhg_mj/learning/trained") for page in (ROOT / folder).glob("*.md"))
TEXTS = [re.sub(r" \\\n +", " ", page.read_text()) for page in PAGES]  # long commands go on in the next line
COMMANDS = sorted({line.strip() for text in TEXTS for line in re.findall(r"^ *commhg-mj .*$", text, re.M)})


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.M | re.S)


def test_the_python_blocks_run(capsys):
    _, interfaces, code = blocks("python")
    exec(interfaces, {})
    assert '"large"' in code and "num_missions=64" in code
    exec(code.replace('"large"', '"small"').replace("num_missions=64", "num_missions=2"), {})
    assert 0 <= float(capsys.readouterr().out) <= 1


def test_the_python_block_of_the_radio_page_runs(capsys):
    text = (ROOT / "docs/radio.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"^```python\n(.*?)^```$", text, re.M | re.S)
    exec(code, {})
    assert re.fullmatch(r"34\.6 m of canopy, 11\.1 dB, SNR 12\.1 dB, passes 1\.000\n", capsys.readouterr().out)


def test_the_python_blocks_of_the_page_on_link_models_run(tmp_path, monkeypatch, capsys):
    """As files: the model in one of its own, which the others import; workers start from the last one, a process itself."""
    text = (ROOT / "docs/link_models.md").read_text(encoding="utf-8")
    model, *scripts, last = re.findall(r"^```python\n(.*?)^```$", text, re.M | re.S)
    (tmp_path / model.splitlines()[0].removeprefix("# ")).write_text(model)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(OWN_MODELS, "two-slope", 0)  # nobody else finds it afterwards
    for script in scripts:
        exec(script.replace('"medium", num_missions=8', '"small", num_missions=2'), {})
    del sys.modules["my_links"]
    (tmp_path / "script.py").write_text(last)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "script.py"], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    said = capsys.readouterr().out + done.stdout
    patterns = (
        r"telemetry delivered: 0\.\d\d by ray casts, 0\.\d\d by two slopes",
        r"162 m, 35 m of it in leaves: 0\.\d{3} pass, 0\.\d{3} in time",
        r"mean TWCR of 32 missions: 0\.\d\d",
    )
    assert re.fullmatch("\n".join(patterns) + "\n", said), said


def test_every_field_of_a_link_is_explained():
    text = (ROOT / "docs/link_models.md").read_text(encoding="utf-8")
    assert [name for row in re.findall(r"^\| (`.*?) \|", text, re.M) for name in re.findall(r"`(\w+)`", row)] == [*LINK.names]


def test_the_blocks_of_the_worlds_page_make_one_world(tmp_path, monkeypatch, capsys):
    text = (ROOT / "docs/worlds.md").read_text(encoding="utf-8")
    (code, robots), (table,) = (re.findall(rf"^```{kind}\n(.*?)^```$", text, re.M | re.S) for kind in ("python", "toml"))
    monkeypatch.chdir(tmp_path)
    made = {}
    exec(code, made)
    assert re.fullmatch(r"27 ellipses, 92 m on the hill\n", capsys.readouterr().out)
    (tmp_path / "valley.toml").write_text(table)
    scenario = load_scenario("valley.toml")
    for one in (scenario.world, made["scenario"].world):
        assert (one.heightmap, one.mountain_height[1]) == (scenario.world.heightmap, 170)
    assert made["missions"].worlds[0].layout.surfaces.max() > 150
    exec(robots, {})
    assert capsys.readouterr().out == "the car rests 0.20 m above the plain\n"


def test_the_methods_block_registers_one():
    code = blocks("python")[0]
    made = {}
    exec(code, made)
    assert METHODS.pop("half-graph") is made["HalfGraph"]
    assert made["HalfGraph"]().communicates is False


def test_a_policy_of_ones_own_takes_less_than_20_lines():
    *_, code = blocks("python")
    policy = re.search(r"^def .*?(?=^\S)", code.split("def ", 1)[1].join(["def ", ""]), re.M | re.S)
    assert 5 < len(policy.group().strip().splitlines()) < 20


def test_the_toml_block_loads(tmp_path):
    (text,) = blocks("toml")
    (tmp_path / "team.toml").write_text(text)
    scenario, table = load_scenario(tmp_path / "team.toml"), tomllib.loads(text)
    assert scenario != SCENARIOS[table["base"]]
    assert (scenario.name, scenario.n_ugv, scenario.world.forest_share) == ("forest-rescue", 0, 0.25)


def test_the_table_of_scenarios():
    rows = {
        cells[0]: cells[1:]
        for cells in ([c.strip() for c in row.split("|")[1:-1]] for row in re.findall(r"^\|.*\|$", README, re.M))
    }
    names = rows[""]
    assert names == list(SCENARIOS)
    for name, side, tasks, team in zip(
        names, rows["map side (m)"], rows["tasks, time limit (s)"], rows["UAVs / UGVs / operators"]
    ):
        s = SCENARIOS[name]
        assert (side, tasks) == (f"{s.map_side:g}", f"{s.n_tasks}, {s.time_limit}")
        assert team == f"{s.n_uav} / {s.n_ugv} / {s.n_operators}"


@pytest.mark.parametrize("line", COMMANDS)
def test_every_command_parses(line):
    words = shlex.split(line, comments=True)
    try:
        command = tyro.cli(cli.Command, args=words[1:])
    except SystemExit:
        pytest.fail(f"not a command: {line}")
    assert type(command).__name__.lower() == words[1]
    policies, scenarios = (several(getattr(command, name, None) or ()) for name in ("policy", "scenario"))
    known = (*POLICIES, *trained_methods(), *(f"planner+{ablation}" for ablation in ABLATIONS))
    bases = {split_variant(without_talk(policy))[0] for policy in policies}
    assert all(policy in known or policy.endswith("/weights.safetensors") for policy in bases)
    assert all(scenario in (*SCENARIOS, "all") or scenario.endswith(".toml") for scenario in scenarios)


def without_talk(policy: str) -> str:
    """A policy's name without the rules that replace what it says."""
    base, _, talk = split_talk(policy)
    return without_talk(base) if talk else base


def several(names) -> set[str]:
    """What an option names, whether it takes one or several."""
    return {names} if isinstance(names, str) else set(names)


def test_every_command_is_shown():
    assert {line.split()[1] for line in COMMANDS} == {c.__name__.lower() for c in cli.Command.__args__}


def anchors(page):
    """What GitHub calls the headings of a page, but for repeated ones."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        name, _, anchor = target.partition("#")
        if "://" not in target:
            there = page.parent / name if name else page
            assert there.exists(), target
            assert not anchor or anchor in anchors(there), target


def test_files_named_in_the_readme_exist():
    for name in re.findall(r"`(\w+\.py)`", README):
        assert list((ROOT / "commhg_mj").rglob(name)), name
    for name in re.findall(r"`(\w+)/`", README):
        assert (ROOT / "commhg_mj" / name).is_dir(), name


def test_every_column_of_observations_is_explained():
    text = (ROOT / "docs/observations.md").read_text(encoding="utf-8")
    kinds = (
        observe.ROBOT_SEES, observe.TASK_SEEN, observe.PEER_SEEN, observe.OPERATOR_SEEN, observe.OPERATOR_SEES,
        observe.REPORT_SEEN,
    )  # fmt: skip
    columns = {name for kind in kinds for name in kind.names} | {*Observations._fields, *Decisions._fields}
    assert not {name for name in columns if f"`{name}`" not in text}
