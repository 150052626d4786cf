"""Model cards: what trained weights are, what they cost and how well they fly, out of their own facts and flights."""

import json

from ..flights.held_out import HELD_OUT
from ..learning.pretrained import BY_ROLLOUTS, VARIANTS
from ..learning.train import learners_of
from ..learning.weights import load_weights
from ..policies import label_of
from ..replay.communication import FIGURES, mean_figures
from ..scenarios import from_json
from .evaluation import compare_scores, evaluate

REFERENCES = ("greedy", "planner", "omniscient")
SCHEDULED = ("no-query", "drawn")  # variants of methods that follow the fixed schedule
N_FLIGHTS = len(REFERENCES) + 1 + len(VARIANTS)  # of a card's missions, at most

CARD = """# {method} for {scenario}

Weights: `{name}.safetensors`. Written by `commhg-mj publish`; nothing here is typed in by hand.

## Training
Learned by {learners}: {missions:,} missions, {decisions:,} decisions to learn from, {updates} updates in
{minutes:.0f} CPU-minutes; the weights that it began with had cost {before:.0f}.

```json
{plan}
```

## Scores
TWCR on {n} held-out missions of {scenario} (seeds {first} to {last}; training never flies them), {links} links, {limitation}
limitation; 95 % bootstrap intervals over missions, for one training seed. Differences are paired mission by mission.

| policy | TWCR | IQM | minus greedy |
|---|---|---|---|
{scores}

Share of the gap between greedy and the omniscient reference that is closed: {gap}.

## What its communication is worth
| policy | TWCR | IQM | minus the whole policy |
|---|---|---|---|
{lacking}

`+no-query` never asks; `+random-gates` broadcasts by chance whenever a broadcast is open (where the method decides on them);
`+drawn` draws its choices, as in training, in place of the best.

## How it communicates
| mean over missions | |
|---|---|
{talk}
"""


def name_of(method, facts: dict) -> str:
    """What weights with such facts go by."""
    return method.name + (BY_ROLLOUTS if "rollouts" in learners_of(facts) else "")


def make_card(path, n_missions: int, links: str, limitation: str, workers: int, advance) -> tuple[str, str]:
    """(name without ending, card in Markdown) of weights, flown on held-out missions of the scenario they were trained on.

    Raises:
      ValueError: the file is refused; the message names it.
    """
    method, facts = load_weights(path)
    if not {"plan", "cpu_seconds", "missions"} <= facts.keys():
        raise ValueError(f"{path} says nothing of its training")
    scenario = from_json(json.dumps(facts["plan"]["scenario"]))
    own = str(path)
    variants = [f"{own}+{variant}" for variant in (VARIANTS if method.communicates else SCHEDULED)]
    flights = evaluate(scenario, [*REFERENCES, own, *variants], n_missions, links, limitation, workers, advance)
    rows = compare_scores({policy: flights[policy] for policy in (*REFERENCES, own)})
    greedy, _, omniscient, learned = (row["twcr"].mean for row in rows)
    gap = f"{(learned - greedy) / (omniscient - greedy):.0%}" if omniscient > greedy else "there is none"
    lacking = compare_scores({policy: flights[policy] for policy in (own, *variants)})
    called = name_of(method, facts)
    name = f"{called}-{scenario.name}"
    card = CARD.format(
        method=called, scenario=scenario.name, name=name, learners=", then ".join(learners_of(facts)), missions=facts["missions"],
        decisions=facts["decisions"], updates=facts["updates"], minutes=facts["cpu_seconds"] / 60,
        before=facts["cpu_seconds_before"] / 60, plan=json.dumps(facts["plan"] | {"scenario": scenario.name}, indent=2),
        n=n_missions, first=HELD_OUT, last=HELD_OUT + n_missions - 1, links=links, limitation=limitation,
        scores=_lines(rows, own, called), gap=gap,
        lacking=_lines(lacking, own, called),
        talk="\n".join(f"| {FIGURES[name]} | {value} |" for name, value in mean_figures([f for _, f in flights[own]]).items()),
    )  # fmt: skip
    return name, card


def _lines(rows, own, name):
    """Rows of a table, in which the weights go by their method's name."""
    shown = ("policy", "twcr", "iqm", "difference")
    return "\n".join(f"| {' | '.join(str(row[key]) for key in shown)} |".replace(label_of(own), name, 1) for row in rows)
