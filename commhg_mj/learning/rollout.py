"""One rollout for every method: fly, decide, remember what an update needs."""

from typing import NamedTuple

import numpy as np
import torch

from ..base.terms import KEEP, REST, Activity
from ..mission.batch import MissionBatch
from ..mission.decide import Decisions
from ..policies import POLICIES
from .advantage import estimate_advantages
from .batches import RobotBatch, join_operators, join_robots, legal_picks, operator_batch, pick_robots, robot_batch, shifted
from .critic import N_PARTS, Agents, Local, judge_values
from .first_targets import assign, beginners, take_turns
from .graphs import GraphBuilder, OperatorGraphs, RobotGraphs
from .heads import (
    ALL_DRAWN,
    Likelihood,
    RobotChoices,
    RobotLogits,
    choose_operators,
    choose_robots,
    judge_operators,
    judge_robots,
    noisy_tasks,
    tensors_of,
)
from .states import States, read_states

VALUE_CHUNK = 2048  # states
FAILED = int(Activity.FAILED)


class Experience(NamedTuple):
    """Decisions of N robots and K operators in S states, in the order of states."""

    states: States
    robots: RobotGraphs  # `mission` is the row of `public`
    operators: OperatorGraphs
    public: np.ndarray  # [worlds, T, PUBLIC.width]
    robot_choices: RobotChoices
    operator_choices: np.ndarray  # [K] i8
    robot_state: np.ndarray  # [N] i8 rising
    operator_state: np.ndarray  # [K] i8 rising
    # Robots', then operators'.
    log_probs: tuple[np.ndarray, np.ndarray]  # [N], [K] f4 of the choices as they were made
    free: tuple[np.ndarray, np.ndarray]  # [N], [K] bool: there was a choice
    advantages: tuple[np.ndarray, np.ndarray]  # [N, 2], [K, 2] mission, coordination
    returns: tuple[np.ndarray, np.ndarray]  # [N, 2], [K, 2]


class Decided(NamedTuple):
    """What one step's due robots and operators saw and chose."""

    robots: RobotGraphs
    operators: OperatorGraphs
    choices: RobotChoices
    picks: np.ndarray  # [K] i8 operators' choices
    log_probs: tuple[np.ndarray, np.ndarray]  # [N], [K] f4 of the choices; empty where nobody asked
    free: tuple[np.ndarray, np.ndarray]  # [N], [K] bool: there was a choice; likewise
    decisions: Decisions


NO_CHOICES = RobotChoices(*(np.zeros(0, kind) for kind in (int, bool, int, bool)))
NOT_ASKED = np.zeros(0, np.float32), np.zeros(0, bool)


def unchanged(logits) -> RobotLogits:
    return logits


class Actors:
    """Decides for all who are due by a method's actors.

    Args:
      change: RobotLogits -> RobotLogits, for policies that are to lack something.
      asks: the fixed schedule's queries, for methods that follow it.
    """

    def __init__(self, method, builder: GraphBuilder, change=unchanged, asks=True):
        self.method, self.builder, self.change, self.asks = method, builder, change, asks

    def score(self, robots: RobotGraphs, public) -> tuple[RobotBatch, RobotLogits]:
        """(the graphs as tensors, what the actor says of them)."""
        batch = robot_batch(robots, public.shape[1])
        return batch, self.change(self.method.robot_logits(batch, torch.from_numpy(public.reshape(-1, public.shape[2]))))

    @torch.no_grad()
    def decide(self, seen, public, rng, drawn=ALL_DRAWN, is_learning=False, teacher=None) -> Decided:
        """Choices of the actors, or a teacher policy's as if the actors had made them.

        Args:
          drawn: heads whose choices are drawn; the others' are their best.
          public: [worlds, T, PUBLIC.width]; `seen`'s missions are its rows.
          is_learning: the choices' likelihoods will be asked for.
        """
        robots, operators = self.builder.robots(seen), self.builder.operators(seen)
        taught = from_decisions(robots, operators, decisions := teacher(seen)) if teacher else (None, None)
        robots, choices, robots_judged = self._decide_robots(robots, public, rng, drawn, is_learning, taught[0])
        picks, operators_judged = self._decide_operators(operators, rng, drawn, is_learning, taught[1])
        if not teacher or self.method.picks_first:
            decisions = to_decisions(robots, choices, picks)
        if not self.method.communicates:
            self.builder.talk(seen, decisions, self.asks)
        return Decided(robots, operators, choices, picks, *zip(robots_judged, operators_judged), decisions)

    def _decide_robots(self, robots, public, rng, drawn, is_learning, taught):
        """(graphs with what was open to them, choices, (likelihoods, whether there was a choice))."""
        if not len(robots.itself):
            return robots, NO_CHOICES, NOT_ASKED
        batch, logits = self.score(robots, public)
        beginning = beginners(robots) if self.method.picks_first else []
        if len(beginning):
            robots, first = take_turns(robots, assign(robots) if taught else noisy_tasks(logits, robots, rng, drawn))
            masks = torch.from_numpy(robots.task_legal), torch.from_numpy(robots.keep_idle)
            batch = batch._replace(task_legal=masks[0], keep_idle=masks[1])
        choices = taught or choose_robots(logits, robots, rng, drawn)
        if len(beginning):
            choices.task[beginning] = first
        return robots, choices, judged(judge_robots(logits, batch, tensors_of(choices))) if is_learning else NOT_ASKED

    def _decide_operators(self, operators, rng, drawn, is_learning, taught):
        """(choices, (likelihoods, whether there was a choice))."""
        if not len(operators.itself):
            return np.zeros(0, np.int64), NOT_ASKED
        batch = operator_batch(operators)
        logits, legal = self.method.operator_logits(batch), legal_picks(batch)
        picks = choose_operators(logits, legal.numpy(), rng, drawn) if taught is None else taught
        return picks, judged(judge_operators(logits, legal, torch.from_numpy(picks))) if is_learning else NOT_ASKED


def judged(likelihood: Likelihood) -> tuple[np.ndarray, np.ndarray]:
    """(log-probabilities, whether there was a choice)."""
    return likelihood.log_prob.numpy(), likelihood.is_free.numpy()


def to_decisions(robots: RobotGraphs, choices: RobotChoices, operator_choices) -> Decisions:
    """Choices as the mission takes them."""
    edges = choices.task
    task = np.where(edges >= 0, robots.task[np.maximum(edges, 0)], edges) if len(robots.task) else edges
    operator = np.where(operator_choices >= 2, operator_choices - 2, np.where(operator_choices == 0, KEEP, REST))
    return Decisions(
        task.astype(np.int32), choices.gate.astype(bool), choices.query.astype(np.int32), choices.assist.astype(bool),
        operator.astype(np.int32),
    )  # fmt: skip


class Collector:
    """Flies missions side by side, each followed by the next seed, and cuts what happens into `Experience`.

    Args:
      first_seed: of the first mission; the others count on from it.
      rng: numpy Generator of all choices.
      teacher: name of the policy that may decide in place of the method.
    """

    def __init__(self, method, scenario, first_seed, n_missions, links, limitation, rng, teacher="greedy"):
        self.method, self.rng, self.make_teacher = method, rng, POLICIES[teacher].make
        self.next_seed = first_seed + n_missions
        self._fly(MissionBatch(scenario, range(first_seed, self.next_seed), links, limitation))
        self.scores = []  # TWCR of missions that have ended

    def _fly(self, batch):
        self.batch, self.builder = batch, GraphBuilder(batch, self.method.wants)
        self.actors, self.teacher = Actors(self.method, self.builder), self.make_teacher(batch)
        self.public = self.builder.public(batch.state.tasks)

    def _remembered(self):
        """All arrays of what actors and the teacher remember."""
        return [*self.builder.remembered(), *getattr(self.teacher, "memory", ())]

    def state_dict(self) -> dict:
        """Missions under way, as tensors and numbers."""
        arrays = {name: torch.from_numpy(array.view(np.uint8).copy()) for name, array in self.batch.state._asdict().items()}
        memory = [torch.from_numpy(columns.copy()) for columns in self._remembered()]
        return {
            "seeds": self.batch.seeds, "next_seed": self.next_seed, "arrays": arrays, "memory": memory, "scores": self.scores,
        }  # fmt: skip

    def load_state_dict(self, state: dict) -> None:
        """Go on where another collector of the same options stood."""
        old = self.batch
        batch = MissionBatch(old.scenario, state["seeds"], old.links, old.limitation)
        kinds = batch.state._asdict()
        batch.restore({name: tensor.numpy().view(kinds[name].dtype) for name, tensor in state["arrays"].items()})
        self.next_seed, self.scores = state["next_seed"], state["scores"]
        self._fly(batch)
        for columns, tensor in zip(self._remembered(), state["memory"]):
            columns[:] = tensor.numpy()

    def collect(self, n_decisions: int, critic, scale, gamma, lam, trace="decision", is_taught=False) -> Experience:
        """At least so many robot decisions; the teacher may make them, whose choices are then remembered."""
        steps, batch = [], self.batch
        batch.discount = gamma
        worlds, world_of = [self.public.copy()], np.arange(len(batch.seeds))  # a restart overwrites `public`
        n = 0
        while n < n_decisions:
            seen, time = batch.observations, batch.time
            over = batch.over
            scores = batch.scores() if over.any() else []
            for e in np.flatnonzero(over):
                self.scores.append(scores[e].twcr)
                batch.restart(e, self.next_seed)
                self.next_seed += 1
                self.public[e] = self.builder.public(batch.state.tasks[e : e + 1])[0]
                world_of[e] = sum(map(len, worlds))
                worlds.append(self.public[e : e + 1].copy())
            time[over] = 0.0
            teacher = self.teacher if is_taught else None
            decided = self.actors.decide(seen, self.public, self.rng, is_learning=True, teacher=teacher)
            robots, operators = decided.robots, decided.operators
            missions = np.flatnonzero(~over)
            state_of = np.cumsum(~over) - 1
            states = read_states(batch, self.builder.scale[0], missions)
            batch.step_legal(decided.decisions)
            at = (robots.mission, robots.robot), (operators.mission, batch.scenario.n_robots + operators.operator)
            robots_in, operators_in = state_of[robots.mission], state_of[operators.mission]
            decided = decided._replace(robots=robots._replace(mission=world_of[robots.mission]))
            steps.append((states, decided, robots_in, operators_in, at, batch.rewards, batch.time - time, batch.over))
            n += len(robots.itself)
        return self._experience(steps, np.concatenate(worlds), critic, scale, (gamma, lam, trace))

    def _experience(self, steps, public, critic, scale, fading):
        states, decided, robots_in, operators_in, at, rewards, elapsed, over = zip(*steps)
        decided = Decided(*zip(*decided))
        starts = np.cumsum([0] + [len(part.robot) for part in states])
        robot_state = np.concatenate([part + start for part, start in zip(robots_in, starts)])
        operator_state = np.concatenate([part + start for part, start in zip(operators_in, starts)])
        joined = States(*(np.concatenate(arrays) for arrays in zip(*states)))
        robots, operators = join_robots(decided.robots), join_operators(decided.operators)
        agents = (robot_state, robots.robot), (operator_state, operators.operator)
        values = value_agents(critic, scale, joined, *agents, robots, operators, public)
        n_robots = [len(part.itself) for part in decided.robots]
        cuts = np.cumsum(n_robots)[:-1], np.cumsum([len(part.itself) for part in decided.operators])[:-1]
        both = [np.concatenate(pair) for pair in zip(*map(np.split, values, cuts))]  # by step
        rows = [tuple(np.concatenate(pair) for pair in zip(*two)) for two in at]
        last = self._last_values(critic, scale)
        parts = estimate_advantages(both, rows, np.array(rewards), np.array(elapsed), np.array(over), last, *fading)
        advantages = [np.concatenate(role) for role in zip(*((part[:n], part[n:]) for part, n in zip(parts, n_robots)))]
        log_probs, free = (tuple(map(np.concatenate, zip(*columns))) for columns in (decided.log_probs, decided.free))
        return Experience(
            joined, robots, operators, public, join_choices(decided.robots, decided.choices), np.concatenate(decided.picks),
            robot_state, operator_state, log_probs, free, advantages,
            tuple(advantage + value for advantage, value in zip(advantages, values)),
        )  # fmt: skip

    def _last_values(self, critic, scale):
        """[E, agents, 2] after the last step; 0 where a mission is over.

        A failed robot decides no more, so that nobody learns what it is worth; but it shares its team's reward. The mean of
        those that fly stands for it.
        """
        batch, builder = self.batch, self.builder
        seen, e = batch.observe_everyone(), np.arange(len(batch.seeds))
        robots, operators = builder.robots(seen), builder.operators(seen)
        agents = (robots.mission, robots.robot), (operators.mission, operators.operator)
        states = read_states(batch, builder.scale[0], e)
        values = value_agents(critic, scale, states, *agents, robots, operators, self.public)
        last = [np.zeros((len(e), n, N_PARTS)) for n in (batch.scenario.n_robots, batch.scenario.n_operators)]
        for table, at, value in zip(last, agents, values):
            table[at] = value
        flies = (batch.state.robots["activity"] != FAILED)[..., None]
        mean = (last[0] * flies).sum(axis=1, keepdims=True) / np.maximum(1, flies.sum(axis=1, keepdims=True))
        last[0] = np.where(flies, last[0], mean * ~batch.over[:, None, None])
        return np.concatenate(last, axis=1)


def change_rate(data: Experience) -> float:
    """Share of the robots' decisions that left a task which could be kept, where there was another choice.

    Of a method that keeps unless it is triggered, how often it is.
    """
    graphs = data.robots
    rows = np.repeat(np.arange(len(graphs.itself)), np.diff(graphs.task_ptr))
    others = graphs.keep_idle[:, 1] | (np.bincount(rows[graphs.task_legal], minlength=len(graphs.itself)) > 0)
    is_open = graphs.keep_idle[:, 0] & others
    return float(np.mean(data.robot_choices.task[is_open] != KEEP)) if is_open.any() else 0.0


def from_decisions(robots: RobotGraphs, operators: OperatorGraphs, decisions: Decisions) -> tuple:
    """(robots' choices, operators' choices) of decisions that somebody else has made."""
    task = edges_of(robots, decisions.task.astype(np.int64)[:, None])[:, 0]
    choices = RobotChoices(task, decisions.broadcast, decisions.query.astype(np.int64), decisions.assist)
    return choices, picks_of(decisions.operator.astype(np.int64))


def edges_of(graphs: RobotGraphs, tasks: np.ndarray) -> np.ndarray:
    """[N, C] edges of each row's tasks [N, C], KEEP for its own or one without an edge; what is no task stays."""
    rows = np.repeat(np.arange(len(tasks)), np.diff(graphs.task_ptr))
    edges = np.full((len(tasks), 1 + max(graphs.task.max(initial=0), tasks.max(initial=0))), KEEP)
    edges[rows, graphs.task] = np.arange(len(graphs.task))
    found = np.where(tasks >= 0, edges[np.arange(len(tasks))[:, None], np.maximum(tasks, 0)], tasks)
    return np.where((found >= 0) & (found == graphs.own_edge[:, None]), KEEP, found)


def picks_of(operator: np.ndarray) -> np.ndarray:
    """Columns of operators' logits of their choices; what is no choice stays."""
    return np.where(operator >= 0, operator + 2, np.where(operator == KEEP, 0, np.where(operator == REST, 1, operator)))


def join_choices(robots: list[RobotGraphs], choices: list[RobotChoices]) -> RobotChoices:
    """The choices of several steps, with edges as `join_robots` numbers them."""
    starts = np.cumsum([0] + [len(part.task) for part in robots])
    tasks = [shifted(part.task, start) for part, start in zip(choices, starts)]
    return RobotChoices(np.concatenate(tasks), *(np.concatenate(column) for column in list(zip(*choices))[1:]))


@torch.no_grad()
def value_agents(critic, scale, states: States, robots_at, operators_at, robots, operators, public) -> list[np.ndarray]:
    """[robots' [n, 2], operators' [k, 2]] values in units of reward.

    Args:
      robots_at, operators_at: (rising state, number) of each agent, who has a row in `robots` or `operators`.
      public: [worlds, T, PUBLIC.width], which `robots.mission` is a row of.
    """
    parts = []
    for start in range(0, len(states.robot), VALUE_CHUNK):
        chunk, asked, rows = States(*(torch.from_numpy(array[start : start + VALUE_CHUNK]) for array in states)), [], []
        for state, agent in (robots_at, operators_at):
            mine = np.arange(*np.searchsorted(state, [start, start + VALUE_CHUNK]))
            asked.append(Agents(torch.from_numpy(state[mine] - start), torch.from_numpy(agent[mine])))
            rows.append(mine)
        local = Local(
            robot_batch(pick_robots(robots, rows[0])[0], public.shape[1]), torch.from_numpy(public.reshape(-1, public.shape[2])),
            operator_batch(operators, rows[1]),
        ) if critic.reads == "local" else None  # fmt: skip
        values = judge_values(critic, chunk, *asked, local)
        parts.append([scale.real(role, value).numpy() for role, value in enumerate(values)])
    return [np.concatenate(columns) for columns in zip(*parts)]
