"""The objective against its formula, and old likelihoods against those of the rollout."""

import dataclasses

import numpy as np
import pytest
import torch
from learners import NAMES, QUICK, Row, experience, run
from torch import nn
from torch.nn.functional import logsigmoid

from commhg_mj.learning.batches import robot_batch
from commhg_mj.learning.critic import N_PARTS, ReturnScale
from commhg_mj.learning.heads import RobotChoices, RobotLogits, judge_robots
from commhg_mj.learning.ppo import Hyper, Learner
from commhg_mj.policies import POLICIES
from commhg_mj.terms import KEEP

pytestmark = pytest.mark.filterwarnings("ignore:Mean of empty slice", "ignore:invalid value", "ignore:Degrees of freedom")
PLAIN = Hyper(epochs=1, minibatches=1, entropy=0.0, value=0.0, max_grad=1e9, target_kl=1e9)
SPEAKER = Row(keep=True, idle=False, gate=True, query=(True,), assist=False)  # free: its gate and its query


class Toy(nn.Module):
    """One logit a component; its likelihoods before the update are those of other logits."""

    def __init__(self, gate=0.0, query=0.0, robot=0.0):
        super().__init__()
        logits = {"gate": gate, "query": query, "robot": robot}
        self.now = nn.ParameterDict({name: nn.Parameter(torch.tensor(value)) for name, value in logits.items()})
        self.scale = ReturnScale()

    def logits(self, name, n):
        # `update` judges the old policy without gradients.
        return (self.now[name] if torch.is_grad_enabled() else torch.tensor(0.0)).expand(n)

    def robot(self, graphs, public):
        n = len(graphs.itself)
        query = torch.stack([torch.zeros(n), self.logits("query", n)], dim=1)
        return RobotLogits(torch.zeros(len(graphs.rows)), torch.zeros(n, 2), self.logits("gate", n), query, torch.zeros(n))

    def operator(self, graphs):
        k, r = graphs.legal.shape
        return torch.cat([torch.zeros(k, 2), self.logits("robot", k)[:, None], torch.full((k, r - 1), -50.0)], dim=1)

    def critic(self, states):
        return tuple(torch.zeros(*agents.shape[:2], N_PARTS) for agents in (states.robot, states.operator))


def choices(gate, query):
    n = len(gate)
    return RobotChoices(np.full(n, KEEP), np.array(gate), np.array(query) - 1, np.zeros(n, bool))


def gradients(toy, data):
    """(policy loss, {logit: gradient}) of one update."""
    loss = Learner(toy, PLAIN).update(data, np.random.default_rng(0))["policy_loss"]
    return loss, {name: float(value.grad) if value.grad is not None else 0.0 for name, value in toy.now.items()}


def surrogate(toy, data, each=False):
    """(loss, gradients) by the formula, for robots alone; `each`: clipped a component, as it should not be."""
    gate, query = toy.now["gate"], toy.now["query"]
    total = torch.from_numpy(data.robot_advantage.sum(axis=1))
    advantage = (total - total.mean()) / total.std(correction=0)
    said, asked = (torch.from_numpy(column) for column in (data.robot_choices.gate, data.robot_choices.query >= 0))
    old = np.log(0.5)
    parts = [torch.where(yes, logsigmoid(p), logsigmoid(-p)) - old for yes, p in ((said, gate), (asked, query))]
    clip = lambda ratio: torch.min(ratio * advantage, ratio.clamp(1 - PLAIN.clip, 1 + PLAIN.clip) * advantage)
    ratios = [part.exp() for part in parts] if each else [(parts[0] + parts[1]).exp()]
    loss = -sum(clip(ratio).mean() for ratio in ratios) / len(ratios)
    grads = torch.autograd.grad(loss, [gate, query])
    return loss.item(), dict(zip(("gate", "query"), map(float, grads)))


# One speaks and asks with success, the others fail; the logits have moved since.
MOVED = {
    "apart, together within": (1.5, -1.5),
    "each within, together beyond": (0.35, 0.35),
}  # fmt: skip


@pytest.mark.parametrize("case", MOVED)
def test_one_joint_ratio_is_clipped_once(case):
    gate, query = MOVED[case]
    data = experience([SPEAKER] * 3, choices([True, False, True], [1, 0, 0]), [[3.0, 0.0], [-1.0, 0.0], [-2.0, 1.0]])
    loss, grads = gradients(Toy(gate, query), data)
    wanted_loss, wanted = surrogate(Toy(gate, query), data)
    _, wrong = surrogate(Toy(gate, query), data, each=True)
    assert loss == pytest.approx(wanted_loss, abs=1e-5)
    for name in wanted:
        assert grads[name] == pytest.approx(wanted[name], abs=1e-5)
    assert any(abs(wanted[name] - wrong[name]) > 0.02 for name in wanted), "the case tells nothing apart"


def test_parts_of_the_advantage_are_added_before_normalisation():
    parts = np.array([[100.0, 0.0], [-100.0, 1.0], [50.0, -1.0], [-50.0, 3.0]])
    picked = choices([True, False, True, False], [1, 1, 0, 0])
    loss, grads = gradients(Toy(0.1, 0.1), experience([SPEAKER] * 4, picked, parts))
    wanted_loss, wanted = surrogate(Toy(0.1, 0.1), experience([SPEAKER] * 4, picked, parts))
    apart = (parts - parts.mean(axis=0)) / parts.std(axis=0)
    other_loss, _ = surrogate(Toy(0.1, 0.1), experience([SPEAKER] * 4, picked, apart))
    assert loss == pytest.approx(wanted_loss, abs=1e-5) and grads["gate"] == pytest.approx(wanted["gate"], abs=1e-5)
    assert abs(wanted_loss - other_loss) > 1e-3


def test_a_larger_role_weighs_no_more():
    robots = [SPEAKER] * 2, ([True, False], [1, 0]), [[1.0, 0.0], [-3.0, 0.0]]
    operators = ([2, 1, 0], [[1.0, 0.0], [0.0, 0.0], [-1.0, 0.0]])
    toys = [Toy(0.1, -0.1, 0.1) for _ in range(2)]
    once = gradients(toys[0], experience(robots[0], choices(*robots[1]), robots[2], *operators))
    rows, picked, advantages = robots[0] * 4, choices(*(column * 4 for column in robots[1])), robots[2] * 4
    often = gradients(toys[1], experience(rows, picked, advantages, *operators))
    assert often[0] == pytest.approx(once[0], abs=1e-6)
    for name in once[1]:
        assert often[1][name] == pytest.approx(once[1][name], abs=1e-6) and abs(once[1][name]) > 1e-3


def test_decisions_without_a_choice_do_not_thin_the_loss():
    idle = Row(keep=True, idle=False, gate=False, query=(False,), assist=False)
    advantages = [[1.0, 0.0], [-1.0, 0.0]]
    one = gradients(Toy(0.1, 0.1), experience([SPEAKER] * 2, choices([True, False], [1, 0]), advantages))
    data = experience([SPEAKER, idle] * 2, choices([True, False, False, False], [1, 0, 0, 0]), np.repeat(advantages, 2, axis=0))
    other = gradients(Toy(0.1, 0.1), data)
    assert other[0] == pytest.approx(one[0], abs=1e-6) and other[1] == pytest.approx(one[1], abs=1e-6)


def test_an_update_stops_where_the_policy_has_moved_too_far():
    data = experience([SPEAKER] * 2, choices([True, False], [1, 0]), [[1.0, 0.0], [-1.0, 0.0]])
    steps = []
    for limit in (0.001, 1e9):
        learner = Learner(Toy(1.0, 1.0), dataclasses.replace(PLAIN, epochs=5, target_kl=limit))
        learner.update(data, np.random.default_rng(0))
        steps.append(learner.optimizer.state[learner.method.now["gate"]]["step"].item())
    assert steps == [1, 5]


def collected(tmp_path, method, decisions, teacher=None):
    """(training, experience, log-probabilities as they were when robots decided)."""
    training = run(tmp_path, method)
    collector, then = training.collector, []
    decide = collector.pilot.decide

    def watch(seen, public, rng, is_greedy=False):
        result = decide(seen, public, rng, is_greedy)
        graphs, picked = result[0], result[2]
        if len(graphs.itself):
            batch = robot_batch(graphs, public.shape[1])
            with torch.no_grad():
                logits = training.method.robot(batch, torch.from_numpy(public.reshape(-1, public.shape[2])))
                chosen = RobotChoices(*map(torch.from_numpy, picked))
                then.append(judge_robots(logits, batch, chosen).log_prob.numpy())
        return result

    collector.pilot.decide = watch
    hyper = QUICK
    data = collector.collect(decisions, training.method.critic, training.method.scale, hyper.gamma, hyper.lam, teacher)
    return training, data, np.concatenate(then)


# Methods that do not read the public table never notice.


@pytest.mark.parametrize("method, decisions", [
    *((method, 40) for method in NAMES), *((method, 300) for method in NAMES),
])  # fmt: skip
def test_old_likelihoods_are_those_of_the_rollout(tmp_path, method, decisions):
    training, data, then = collected(tmp_path, method, decisions)
    now = training.learner._judge_all(data)[0].numpy()
    np.testing.assert_allclose(now, then, atol=2e-4)
    rows = np.sort(np.random.default_rng(0).permutation(len(then))[: len(then) // 2])
    with torch.no_grad():
        np.testing.assert_allclose(training.learner._judge_robots(data, rows).log_prob, then[rows], atol=2e-4)


@pytest.mark.parametrize("method", NAMES)
def test_cloning_makes_greedys_choices_likelier(tmp_path, method):
    training = run(tmp_path, method, hyper=dataclasses.replace(QUICK, epochs=8))
    teacher = POLICIES["greedy"].make(training.collector.batch)
    data = training.collector.collect(150, training.method.critic, training.method.scale, 0.99, 0.9, teacher)
    spoilt = data._replace(robot_advantage=-data.robot_advantage * 7, operator_advantage=data.operator_advantage * 0 + 3)
    before = [likely.mean().item() for likely in training.learner._judge_all(data)]
    training.learner.update(spoilt, np.random.default_rng(0), is_cloning=True)
    after = [likely.mean().item() for likely in training.learner._judge_all(data)]
    assert after[0] > before[0] + 0.1 and after[1] > before[1]
