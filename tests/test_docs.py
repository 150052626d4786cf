"""What the docs say of the rules is the code's: every field with its number, every file; what the code cites is there."""

import re
from pathlib import Path

from commhg_mj.cli.console import show
from commhg_mj.scenarios import SCENARIOS, describe

ROOT = Path(__file__).parent.parent
RULES = (ROOT / "docs/benchmark.md").read_text(encoding="utf-8")
SOURCES = [*sorted((ROOT / "commhg_mj").rglob("*.py")), *sorted((ROOT / "examples").glob("*.py"))]
CITED = re.compile(r"benchmark(?:\.md)?,\s+sections?\s+(\d+(?:(?:, | and )\d+)*)")
PAGE = re.compile(r"(?<![}\w])[\w/.-]*\w\.md\b")  # a name in an f-string is no citation


def cited_sections():
    """(file, section) of every citation of the rules."""
    for path in SOURCES:
        for numbers in CITED.findall(path.read_text(encoding="utf-8")):
            yield from ((path.name, number) for number in re.findall(r"\d+", numbers))


def rows(text):
    """{field: [cells]} of the tables of fields."""
    cells = ([cell.strip() for cell in row.strip("|").split("|")] for row in re.findall(r"^\| `[\w.]+` \|.*$", text, re.M))
    return {name.strip("`"): others for name, *others in cells if len(others) == 4}


def test_the_sections_that_the_code_cites_are_there():
    headings = re.findall(r"^## (\d+)\. ", RULES, re.M)
    assert headings == [str(number) for number in range(1, len(headings) + 1)]
    cited = list(cited_sections())
    assert len({name for name, _ in cited}) >= 7
    assert [(name, number) for name, number in cited if number not in headings] == []


def test_the_code_cites_pages_of_this_repository_alone():
    """By their place from the root; `design: …` and a section of nothing lead nowhere."""
    astray = []
    for path in SOURCES:
        text = path.read_text(encoding="utf-8")
        found = [*re.findall(r"\bdesign[:,] .*", text), *re.findall(r"\(sections? \d.*", text)]
        found += [page for page in PAGE.findall(text) if not (ROOT / page).exists()]
        astray += [(str(path.relative_to(ROOT)), citation) for citation in found]
    assert astray == []


def test_every_field_is_in_the_tables_as_commhg_mj_scenarios_prints_it():
    told = rows(RULES) | rows((ROOT / "docs/radio.md").read_text(encoding="utf-8"))
    printed = {}
    for columns in zip(*(describe(scenario) for scenario in SCENARIOS.values())):
        name, _, unit, mark, _ = columns[0]
        values = [show(value) for _, value, *_ in columns]
        printed[name] = [values[0] if len(set(values)) == 1 else " / ".join(values), unit, mark]
    assert {name: cells[:3] for name, cells in told.items()} == printed
    assert all(cells[3] for cells in told.values()), "a field without its meaning"


def test_every_rule_is_marked_and_leads_to_its_file():
    numbered = RULES[RULES.index("## 1. ") : RULES.index("## Calibration")]
    rules = re.findall(r"^- .*?(?=^- |^$)", numbered, re.M | re.S)
    assert len(rules) > 70
    for rule in rules:
        assert ".md" in rule or "](../commhg_mj/" in rule and re.search(r"\[[PD]\]", rule), rule


def test_every_file_of_rules_is_linked():
    linked = set(re.findall(r"\]\(\.\./commhg_mj/mission/(\w+\.py)\)", RULES))
    assert linked == {path.name for path in (ROOT / "commhg_mj/mission").glob("*.py")} - {"__init__.py"}


def test_a_link_to_a_file_is_called_by_its_place():
    for name, target in re.findall(r"\[`([^`]+)`\]\(([^)]+)\)", RULES):
        assert target == f"../commhg_mj/{name}"
