"""Likelihood and entropy of joint decisions against enumeration, sampling against likelihood."""

import itertools
from math import log

import numpy as np
import pytest
import torch
from learners import Row, random_row, robot_graphs

from commhg_mj.base.terms import IDLE, KEEP, NOBODY
from commhg_mj.learning.batches import robot_batch
from commhg_mj.learning.heads import (
    ALL_DRAWN,
    NONE_DRAWN,
    RobotChoices,
    RobotLogits,
    choose_operators,
    choose_robots,
    judge_operators,
    judge_robots,
)

HEADS = ("gate", "query", "assist")
FIXED = Row((False,), keep=True, idle=False, gate=False, query=(False, False), assist=False)  # a prescribed task


def random_logits(rng, rows, without=()):
    n, n_edges, n_operators = len(rows), sum(len(row.tasks) for row in rows), len(rows[0].query)
    shapes = {"task": (n_edges,), "keep_idle": (n, 2), "gate": (n,), "query": (n, 1 + n_operators), "assist": (n,)}
    return RobotLogits(**{
        name: None if name in without else torch.from_numpy(rng.normal(0, 2, shape)).float() for name, shape in shapes.items()
    })  # fmt: skip


def softmax(logits: dict) -> dict:
    top = max(logits.values())
    weights = {choice: np.exp(value - top) for choice, value in logits.items()}
    return {choice: weight / sum(weights.values()) for choice, weight in weights.items()}


def components(row, logits, i, edge):
    """Per component of row i, whose edges begin at `edge`: {choice: probability}; assistance as if nobody was asked."""
    of = lambda name, *at: float(getattr(logits, name)[at])
    task = {edge + j: of("task", edge + j) for j, legal in enumerate(row.tasks) if legal}
    task |= {choice: of("keep_idle", i, k) for k, (choice, is_open) in enumerate(((KEEP, row.keep), (IDLE, row.idle))) if is_open}
    parts = {"task": task}
    if logits.gate is not None:
        parts["gate"] = {False: 0.0} | ({True: of("gate", i)} if row.gate else {})
    if logits.query is not None:
        parts["query"] = {NOBODY: of("query", i, 0)} | {h: of("query", i, 1 + h) for h, legal in enumerate(row.query) if legal}
    if logits.assist is not None:
        parts["assist"] = {False: 0.0} | ({True: of("assist", i)} if row.assist else {})
    return {name: softmax(options) for name, options in parts.items()}


def joint(parts) -> dict:
    """{(task, gate, query, assist): (probability, relative entropies of its free components)} of everything legal."""
    whole = {"task": {}, "gate": {False: 1.0}, "query": {NOBODY: 1.0}, "assist": {False: 1.0}} | parts
    outcomes = {}
    for choice in itertools.product(*whole.values()):
        open_now = dict(whole)
        if choice[2] != NOBODY:
            if choice[3]:
                continue  # assistance is not open beside a query
            open_now["assist"] = {False: 1.0}
        probability = np.prod([open_now[name][pick] for name, pick in zip(open_now, choice)])
        free = [options for options in open_now.values() if len(options) > 1]
        entropies = [-sum(p * log(p) for p in options.values()) / log(len(options)) for options in free]
        outcomes[choice] = (probability, entropies)
    return outcomes


def judge(rows, logits, choices):
    """`judge_robots` of one tuple of choices a row."""
    columns = [torch.tensor(column) for column in zip(*choices)]
    return judge_robots(logits, robot_batch(robot_graphs(rows), 5), RobotChoices(*columns))


def many_rows(seed, without, n=40):
    rng = np.random.default_rng(seed)
    rows = [FIXED, *(random_row(rng) for _ in range(n))]
    logits = random_logits(rng, rows, without)
    starts = np.cumsum([0] + [len(row.tasks) for row in rows])
    return rows, logits, [joint(components(row, logits, i, int(starts[i]))) for i, row in enumerate(rows)]


@pytest.mark.parametrize("without", [(), ("query",), HEADS], ids=["all heads", "no query", "task alone"])
def test_joint_likelihood_and_entropy_are_those_of_an_enumeration(without):
    rows, logits, outcomes = many_rows(0, without)
    for turn in range(max(map(len, outcomes))):  # every row's outcomes, one after the other
        chosen = [list(each)[turn % len(each)] for each in outcomes]
        judged = judge(rows, logits, chosen)
        wanted = [each[choice] for each, choice in zip(outcomes, chosen)]
        np.testing.assert_allclose(judged.log_prob.exp(), [p for p, _ in wanted], rtol=2e-4, atol=1e-7)
        np.testing.assert_allclose(judged.entropy, [np.mean(h) if h else 0 for _, h in wanted], atol=2e-5)
        assert judged.is_free.tolist() == [bool(h) for _, h in wanted]


def test_probabilities_of_all_that_is_open_add_up_to_one():
    rows, logits, outcomes = many_rows(1, (), n=12)
    totals = np.zeros(len(rows))
    for turn in range(max(map(len, outcomes))):
        judged = judge(rows, logits, [list(each)[turn % len(each)] for each in outcomes]).log_prob.exp().numpy()
        totals += [p if turn < len(each) else 0 for p, each in zip(judged, outcomes)]
    np.testing.assert_allclose(totals, 1, rtol=1e-4)


def test_what_has_one_legal_choice_neither_counts_nor_learns():
    rows = [FIXED, Row((True, False))]
    logits = random_logits(np.random.default_rng(0), rows)
    for part in logits:
        part.requires_grad_()
    judged = judge(rows, logits, [(KEEP, False, NOBODY, False), (1, True, 1, False)])
    assert judged.log_prob[0] == 0 and judged.entropy[0] == 0 and judged.is_free.tolist() == [False, True]
    (judged.log_prob + judged.entropy).sum().backward()
    assert all(torch.isfinite(part.grad).all() for part in logits)
    assert all(part.grad[0].abs().sum() == 0 for part in logits), "a prescribed task teaches nothing"
    assert logits.task.grad[2] == 0 and logits.task.grad[1] != 0, "an illegal task has no part in the norm"


def test_assistance_counts_only_while_nobody_is_asked():
    rows = [Row()] * 2
    logits = random_logits(np.random.default_rng(0), rows)
    logits.assist.requires_grad_()
    judge(rows, logits, [(IDLE, False, 1, False), (IDLE, False, NOBODY, False)]).log_prob.sum().backward()
    assert logits.assist.grad[0] == 0 and logits.assist.grad[1] != 0


@pytest.mark.parametrize("seed", range(3))
def test_choices_are_drawn_as_often_as_they_are_likely(seed):
    rng, n = np.random.default_rng(seed), 20000
    row = Row((True, False, True), keep=seed != 1, assist=True, gate=seed != 2)
    one = random_logits(rng, [row])
    many = RobotLogits(*(part.repeat(n, *[1] * (part.dim() - 1)) for part in one))
    rows = [row] * n
    drawn = choose_robots(many, robot_graphs(rows), rng)
    edge = np.where(drawn.task >= 0, drawn.task - 3 * np.arange(n), drawn.task)
    counts = {}
    for choice in zip(edge.tolist(), drawn.gate.tolist(), drawn.query.tolist(), drawn.assist.tolist()):
        counts[choice] = counts.get(choice, 0) + 1
    likely = joint(components(row, one, 0, 0))
    assert counts.keys() <= likely.keys(), "something illegal was drawn"
    for choice, (p, _) in likely.items():
        assert abs(counts.get(choice, 0) / n - p) < 5 * np.sqrt(p * (1 - p) / n) + 1e-4, choice


def test_nothing_illegal_is_ever_chosen_and_what_is_not_drawn_is_the_best():
    rows, logits, outcomes = many_rows(2, ())
    graphs, rng = robot_graphs(rows), np.random.default_rng(0)
    starts = np.cumsum([0] + [len(row.tasks) for row in rows])
    for drawn in (ALL_DRAWN,) * 20 + (NONE_DRAWN,):
        picks = choose_robots(logits, graphs, rng, drawn)
        chosen = list(zip(*(column.tolist() for column in picks)))
        assert all(choice in each for choice, each in zip(chosen, outcomes))
    for i, (choice, row) in enumerate(zip(chosen, rows)):
        parts = components(row, logits, i, int(starts[i]))
        best = [max(parts[name], key=parts[name].get) for name in ("task", "gate", "query", "assist")]
        best[3] = best[3] and best[2] == NOBODY
        assert list(choice) == best


def test_operators_are_judged_and_drawn_alike():
    rng, n = np.random.default_rng(0), 20000
    logits, legal = torch.tensor([1.0, -0.5, 2.0, 0.3, -1.0]), np.array([False, True, True, False, True])
    rows, open_to_all = logits.repeat(n, 1), np.tile(legal, (n, 1))
    shares = np.bincount(choose_operators(rows, open_to_all, rng), minlength=5) / n
    wanted = np.where(legal, np.exp(logits.numpy()), 0)
    wanted /= wanted.sum()
    np.testing.assert_allclose(shares, wanted, atol=0.02)
    assert np.all(shares[~legal] == 0)
    assert np.all(choose_operators(rows[:3], open_to_all[:3], rng, NONE_DRAWN) == 2)
    mask = torch.from_numpy(open_to_all[:3])
    judged = judge_operators(rows[:3], mask, torch.tensor([1, 2, 4]))
    np.testing.assert_allclose(judged.log_prob.exp(), wanted[[1, 2, 4]], rtol=1e-5)
    entropy = -sum(p * log(p) for p in wanted if p) / log(3)
    np.testing.assert_allclose(judged.entropy, entropy, rtol=1e-5)
    only = torch.tensor([[False, True, False, False, False]])
    judged = judge_operators(rows[:1], only, torch.tensor([1]))
    assert not judged.is_free[0] and judged.log_prob[0] == 0 == judged.entropy[0]


def test_what_differs_by_float32s_last_bits_alone_ties():
    rng = np.random.default_rng(0)
    logits = np.round(rng.normal(0, 2, (300, 5)), 1)
    logits[:, 3] = logits[:, 1] = logits.max(axis=1)  # equal in exact arithmetic
    noisy = [torch.from_numpy(logits + rng.normal(0, 1e-6, logits.shape)).float() for _ in range(2)]
    picks = [choose_operators(each, np.ones(logits.shape, bool), None, NONE_DRAWN) for each in noisy]
    assert np.array_equal(*picks) and not np.array_equal(*(each.argmax(dim=1) for each in noisy))
