"""The objective against its formula, and old likelihoods against those of the rollout."""

import dataclasses

import far
import numpy as np
import pytest
import torch
from learners import FAMILIES, NAMES, QUICK, SHORT, Row, experience, run, shaken, updated
from strategies import change
from torch import nn
from torch.nn.functional import logsigmoid

from commhg_mj.base.terms import KEEP
from commhg_mj.learning import ppo
from commhg_mj.learning.critic import N_PARTS, ReturnScale
from commhg_mj.learning.heads import LEFT_OUT, RobotChoices, RobotLogits
from commhg_mj.learning.ppo import Hyper, Learner
from commhg_mj.learning.registry import METHODS
from commhg_mj.learning.rollout import FAILED

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
        return self.now[name].expand(n)

    def robot_logits(self, graphs, public):
        n = len(graphs.itself)
        query = torch.stack([torch.zeros(n), self.logits("query", n)], dim=1)
        return RobotLogits(torch.zeros(len(graphs.rows)), torch.zeros(n, 2), self.logits("gate", n), query, torch.zeros(n))

    def operator_logits(self, graphs):
        k, r = graphs.legal.shape
        return torch.cat([torch.zeros(k, 2), self.logits("robot", k)[:, None], torch.full((k, r - 1), -50.0)], dim=1)

    def critic(self, states, *asked):
        return tuple(torch.zeros(len(at.state), N_PARTS) for at in asked)

    critic.reads = "state"

    def auxiliary(self, *decided):
        return None


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
    total = torch.from_numpy(data.advantages[0].sum(axis=1))
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


def collected(tmp_path, method, decisions, teacher=False, **options):
    """(training, experience)."""
    training, hyper = run(tmp_path, method, **options), QUICK
    shaken(training.method)
    parts = training.method.critic, training.method.scale
    return training, training.collector.collect(decisions, *parts, hyper.gamma, hyper.lam, is_taught=teacher)


@torch.no_grad()
def likelihoods(training, data, states, aim="improve"):
    """Log-probabilities of robots' and operators' choices in some states as an update judges them."""
    learner = training.learner
    return [role.log_prob for role in learner.judge(learner.minibatch(data, states), aim)]


# 300 decisions: missions end on the way and others begin. Methods that do not read the public table never notice.
@pytest.mark.parametrize("decisions", [100, 300])
@pytest.mark.parametrize("method", FAMILIES)
def test_an_update_judges_as_the_rollout_did(tmp_path, method, decisions):
    """Same graphs, same masks, same tasks: else the first ratio is not 1."""
    training, data = collected(tmp_path, method, decisions)
    n = len(data.states.mission)
    for states in (np.arange(n), np.sort(np.random.default_rng(0).permutation(n)[: n // 2])):
        for now, old, of in zip(likelihoods(training, data, states), data.log_probs, (data.robot_state, data.operator_state)):
            np.testing.assert_allclose(now, old[np.isin(of, states)], atol=2e-4)
    assert all(old.std() > 0.01 for old in data.log_probs)


@pytest.mark.parametrize("method", FAMILIES)
def test_cloning_makes_greedys_choices_likelier(tmp_path, method):
    training, data = collected(tmp_path, method, 150, teacher=True, hyper=dataclasses.replace(QUICK, epochs=8))
    spoilt = data._replace(advantages=(-data.advantages[0] * 7, data.advantages[1] * 0 + 3))
    states = np.arange(len(data.states.mission))
    before = [likely.mean().item() for likely in likelihoods(training, data, states, "clone")]
    training.learner.update(spoilt, np.random.default_rng(0), "clone")
    after = [likely.mean().item() for likely in likelihoods(training, data, states, "clone")]
    assert after[0] > before[0] + 0.1 and after[1] > before[1]


def test_bigger_teams_decide_more_and_given_weights_are_not_pulled_to_entropy():
    small, large = Hyper.of(3, is_refining=False), Hyper.of(16, is_refining=True, lam=0.5)
    assert small == Hyper() and small.entropy > 0
    assert large.decisions == 2 * small.decisions and large.lam == 0.5
    assert large.entropy == 0 and large.learning_rate < small.learning_rate


def test_cloning_teaches_nobody_not_to_ask(tmp_path):
    """Greedy asks by a fixed rule; PPO is to find out when to."""
    training, data = collected(tmp_path, "commhg", 150, teacher=True)
    assert (data.robot_choices.query >= 0).any()
    training.learner.update(data, np.random.default_rng(0), "clone")
    actor = training.method.robot
    assert all(part.grad is None for head in (actor.query, actor.nobody, actor.query_operator) for part in head.parameters())
    assert actor.gate[0].weight.grad is not None


RECURRENT = {name for name in NAMES if any(isinstance(part, nn.RNNBase) for part in METHODS[name]().modules())}

# torch has fused kernels of its own for recurrent layers on devices; this one has none.
FAR = sorted({*NAMES} - RECURRENT - {"commhg", "mappo"})


@pytest.mark.parametrize("method", ["commhg", "mappo", *(pytest.param(name, marks=pytest.mark.slow) for name in FAR)])
def test_another_device_learns_the_same(tmp_path, method, monkeypatch):
    """No tensor of the update stays behind on the CPU; what was learned comes back to where missions are flown."""
    monkeypatch.setattr(ppo, "check_device", lambda device: None)
    few = dict(hyper=dataclasses.replace(QUICK, decisions=30, minibatches=1), side_by_side=2)  # each operation is one of Python's
    near = updated(run(tmp_path / "near", method, **few), 2)
    with far.Present() as present:
        away = updated(run(tmp_path / "far", method, device="far", **few), 2)
        assert all(parameter.device == far.DEVICE for parameter in away.learner.method.parameters())
        assert all(parameter.is_cpu for parameter in away.method.parameters()) and present.n_operations > 300
    for one, other in zip(near.method.parameters(), away.method.parameters()):
        torch.testing.assert_close(one, other, rtol=1e-3, atol=1e-4)


def test_advantages_are_normalised_over_those_who_had_a_choice():
    """Decisions without one, however large their advantages, move nothing."""
    idle = Row(keep=True, idle=False, gate=False, query=(False,), assist=False)
    rows, picked = [SPEAKER, idle] * 2, choices([True, False, False, False], [1, 0, 0, 0])
    losses = []
    for nonsense in (0.0, 1000.0):
        advantages = [[1.0, 0.0], [nonsense, 0.0], [-1.0, 0.0], [-3.0 * nonsense, 0.0]]
        losses.append(gradients(Toy(0.1, 0.1), experience(rows, picked, advantages)))
    assert losses[0] == losses[1] and abs(losses[0][1]["gate"]) > 1e-3


def test_a_lonely_decision_weighs_as_much_as_any_other():
    """One operator's decision among many states of robots: its minibatch is not its role's whole loss."""
    robots = [SPEAKER] * 8
    data = experience(robots, choices([True, False] * 4, [0] * 8), np.ones((8, 2)), [2, 1], [[1.0, 0.0], [-1.0, 0.0]])
    toy = Toy()
    learner = Learner(toy, dataclasses.replace(PLAIN, minibatches=4))
    weights = []
    policy_loss = learner._policy_loss

    def look(role, rows, now, aim):
        if len(rows):
            ones = role._replace(advantage=torch.ones_like(role.advantage), log_prob=role.log_prob * 0)
            flat = now._replace(log_prob=now.log_prob * 0)
            weights.append((len(role.log_prob), len(rows), -policy_loss(ones, rows, flat, aim)[0].item()))
        return policy_loss(role, rows, now, aim)

    learner._policy_loss = look
    learner.update(data, np.random.default_rng(0))
    for of_role, n, weight in weights:  # by the mean number of the role's decisions in one of the four
        assert weight == pytest.approx(n / (of_role / 4))
    assert {of_role for of_role, *_ in weights} == {8, 2}


def test_a_failed_robots_last_value_is_that_of_those_that_fly(tmp_path):
    training = run(tmp_path, "mappo", side_by_side=2)
    shaken(training.method.critic)
    for role in (0, 1):
        training.method.scale.update(role, torch.randn(50, 2))
    collector = training.collector
    robots = collector.batch.state.robots
    robots["activity"][0, 1] = FAILED
    values = collector._last_values(training.method.critic, training.method.scale)[:, : robots.shape[1]]
    np.testing.assert_allclose(values[0, 1], np.delete(values[0], 1, axis=0).mean(axis=0), rtol=1e-5)
    others = np.delete(values[1], 1, axis=0).mean(axis=0)
    assert not np.allclose(values[0, 0], values[0, 2]) and not np.allclose(values[1, 1], others)
    robots["activity"][1] = FAILED
    assert (collector._last_values(training.method.critic, training.method.scale)[1, : robots.shape[1]] == 0).all()


def test_what_does_not_fit_in_is_not_imitated(tmp_path):
    """A teacher's choice that a method cannot make teaches nothing, in place of pushing all others down."""
    many = run(tmp_path, "mappo", change(SHORT, n_tasks=40, released_at_start=1.0)).collector
    method = shaken(METHODS["mappo"]())
    data = many.collect(60, method.critic, method.scale, 0.99, 0.95, is_taught=True)
    learner = Learner(method, PLAIN)
    batch = learner.minibatch(data, np.arange(len(data.states.mission)))
    with torch.no_grad():
        score = method.robot(*batch.local[:2]).task
    reach = batch.choices.task.clone()
    legal_out = torch.nonzero((score <= LEFT_OUT) & batch.local.robots.task_legal)[:, 0]
    row = batch.local.robots.rows[legal_out[0]]
    reach[row] = legal_out[0]
    pair = [batch._replace(choices=batch.choices._replace(task=task)) for task in (batch.choices.task, reach)]
    judged = [learner.judge(one, "clone")[0] for one in pair]
    assert judged[1].log_prob[row] < ppo.OUT_OF_REACH < judged[0].log_prob.min()
    role = ppo.Role(None, None, None, 1.0, 1.0)
    losses = [learner._policy_loss(role, None, now, "clone")[0] for now in judged]
    assert 0 < losses[1] < losses[0] + 1e-6


def test_imitation_has_a_rate_of_its_own():
    learner, rates = Learner(Toy(), Hyper(learning_rate=0.01, clone_rate=0.1)), []
    for share, aim in ((1.0, "clone"), (0.5, "clone"), (1.0, "improve"), (0.5, "value"), (0.0, "improve")):
        learner.set_rate(share, aim)
        rates.append(learner.optimizer.param_groups[0]["lr"])
    assert rates == pytest.approx([0.1, 0.1, 0.01, 0.005, 0.0005])
