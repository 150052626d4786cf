"""One rollout for every method: fly, decide, remember what an update needs."""

from typing import NamedTuple

import numpy as np
import torch

from ..base.terms import KEEP, REST
from ..mission.batch import MissionBatch
from ..mission.decide import Decisions
from ..policies.schedule import follow_schedule
from .advantage import estimate_advantages
from .batches import RobotBatch, join_operators, join_robots, legal_picks, operator_batch, robot_batch
from .critic import Agents
from .graphs import GraphBuilder, OperatorGraphs, RobotGraphs
from .heads import RobotChoices, RobotLogits, choose_operators, choose_robots, judge_operators, judge_robots, tensors_of
from .states import States, read_states

VALUE_CHUNK = 2048  # states


class Experience(NamedTuple):
    """Decisions of N robots and K operators in S states, in the order of states."""

    states: States
    robots: RobotGraphs  # `mission` is the row of `public`
    operators: OperatorGraphs
    public: np.ndarray  # [worlds, T, PUBLIC.width]
    robot_choices: RobotChoices
    operator_choices: np.ndarray  # [K] i8
    robot_log_prob: np.ndarray  # [N] f4 of the choices as they were made
    operator_log_prob: np.ndarray  # [K] f4
    robot_state: np.ndarray  # [N] i8 rising
    operator_state: np.ndarray  # [K] i8 rising
    robot_advantage: np.ndarray  # [N, 2] mission, coordination
    operator_advantage: np.ndarray  # [K, 2]
    robot_return: np.ndarray  # [N, 2]
    operator_return: np.ndarray  # [K, 2]


class Decided(NamedTuple):
    """What one step's due robots and operators saw and chose."""

    robots: RobotGraphs
    operators: OperatorGraphs
    choices: RobotChoices
    picks: np.ndarray  # [K] i8 operators' choices
    robot_log_prob: np.ndarray  # [N] f4
    operator_log_prob: np.ndarray  # [K] f4
    decisions: Decisions


def unchanged(logits) -> RobotLogits:
    return logits


class Actors:
    """Decides for all who are due by a method's actors.

    Args:
      change: RobotLogits -> RobotLogits, for policies that are to lack something.
    """

    def __init__(self, method, builder: GraphBuilder, change=unchanged):
        self.method, self.builder, self.change = method, builder, change

    def score(self, robots: RobotGraphs, public) -> tuple[RobotBatch, RobotLogits]:
        """(the graphs as tensors, what the actor says of them)."""
        batch = robot_batch(robots, public.shape[1])
        return batch, self.change(self.method.robot(batch, torch.from_numpy(public.reshape(-1, public.shape[2]))))

    @torch.no_grad()
    def decide(self, seen, public, rng, is_greedy=False, is_learning=False) -> Decided:
        """Choices drawn from the actors, or their best.

        Args:
          public: [worlds, T, PUBLIC.width]; `seen`'s missions are its rows.
          is_learning: the choices' likelihoods will be asked for; 0 otherwise.
        """
        robots, operators = self.builder.robots(seen), self.builder.operators(seen)
        choices, picks = RobotChoices(*(np.zeros(0, kind) for kind in (int, bool, int, bool))), np.zeros(0, np.int64)
        robot_log_prob, operator_log_prob = unasked(robots, operators)
        if len(robots.itself):
            batch, logits = self.score(robots, public)
            choices = choose_robots(logits, robots, rng, is_greedy)
            if is_learning:
                robot_log_prob = judge_robots(logits, batch, tensors_of(choices)).log_prob.numpy()
        if len(operators.itself):
            batch = operator_batch(operators)
            logits, legal = self.method.operator(batch), legal_picks(batch)
            picks = choose_operators(logits, legal.numpy(), rng, is_greedy)
            if is_learning:
                operator_log_prob = judge_operators(logits, legal, torch.from_numpy(picks)).log_prob.numpy()
        decisions = to_decisions(robots, choices, picks)
        if not self.method.communicates:
            follow_schedule(seen, decisions)
        return Decided(robots, operators, choices, picks, robot_log_prob, operator_log_prob, decisions)

    def follow(self, seen, teacher) -> Decided:
        """A teacher policy's decisions as if the actors had made them; their likelihood is not asked for."""
        robots, operators, decisions = self.builder.robots(seen), self.builder.operators(seen), teacher(seen)
        choices, picks = from_decisions(robots, operators, decisions)
        return Decided(robots, operators, choices, picks, *unasked(robots, operators), decisions)


def unasked(*graphs) -> list[np.ndarray]:
    """Zeros in place of likelihoods."""
    return [np.zeros(len(part.itself), np.float32) for part in graphs]


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
    """

    def __init__(self, method, scenario, first_seed, n_missions, links, limitation, rng):
        self.method, self.rng = method, rng
        self.next_seed = first_seed + n_missions
        self._fly(MissionBatch(scenario, range(first_seed, self.next_seed), links, limitation))
        self.scores = []  # TWCR of missions that have ended

    def _fly(self, batch):
        self.batch, self.builder = batch, GraphBuilder(batch)
        self.actors = Actors(self.method, self.builder)
        self.public = self.builder.public(batch.state.tasks)

    def state_dict(self) -> dict:
        """Missions under way, as tensors and numbers."""
        arrays = {name: torch.from_numpy(array.view(np.uint8).copy()) for name, array in self.batch.state._asdict().items()}
        return {"seeds": self.batch.seeds, "next_seed": self.next_seed, "arrays": arrays, "scores": self.scores}

    def load_state_dict(self, state: dict) -> None:
        """Go on where another collector of the same options stood."""
        old = self.batch
        batch = MissionBatch(old.scenario, state["seeds"], old.links, old.limitation)
        kinds = batch.state._asdict()
        batch.restore({name: tensor.numpy().view(kinds[name].dtype) for name, tensor in state["arrays"].items()})
        self.next_seed, self.scores = state["next_seed"], state["scores"]
        self._fly(batch)

    def collect(self, n_decisions: int, critic, scale, gamma, lam, trace="decision", teacher=None) -> Experience:
        """At least so many robot decisions; a `teacher` policy may make them, whose choices are then remembered."""
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
            actors = self.actors
            decided = actors.follow(seen, teacher) if teacher else actors.decide(seen, self.public, self.rng, is_learning=True)
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
        values = value_states(critic, scale, joined, (robot_state, robots.robot), (operator_state, operators.operator))
        n_robots = [len(part.itself) for part in decided.robots]
        cuts = np.cumsum(n_robots)[:-1], np.cumsum([len(part.itself) for part in decided.operators])[:-1]
        both = [np.concatenate(pair) for pair in zip(*map(np.split, values, cuts))]  # by step
        rows = [tuple(np.concatenate(pair) for pair in zip(*two)) for two in at]
        last = self._last_values(critic, scale)
        parts = estimate_advantages(both, rows, np.array(rewards), np.array(elapsed), np.array(over), last, *fading)
        advantages = [np.concatenate(role) for role in zip(*((part[:n], part[n:]) for part, n in zip(parts, n_robots)))]
        return Experience(
            joined, robots, operators, public, join_choices(decided.robots, decided.choices), np.concatenate(decided.picks),
            np.concatenate(decided.robot_log_prob), np.concatenate(decided.operator_log_prob), robot_state, operator_state,
            *advantages, *(advantage + value for advantage, value in zip(advantages, values)),
        )  # fmt: skip

    def _last_values(self, critic, scale):
        """[E, agents, 2] after the last step; 0 where a mission is over."""
        batch, scenario = self.batch, self.batch.scenario
        n = len(batch.seeds)
        everyone = [tuple(np.divmod(np.arange(n * k), max(k, 1))) for k in (scenario.n_robots, scenario.n_operators)]
        values = value_states(critic, scale, read_states(batch, self.builder.scale[0], np.arange(n)), *everyone)
        return np.concatenate([value.reshape(n, -1, 2) for value in values], axis=1) * ~batch.over[:, None, None]


def from_decisions(robots: RobotGraphs, operators: OperatorGraphs, decisions: Decisions) -> tuple:
    """(robots' choices, operators' choices) of decisions that somebody else has made."""
    task = decisions.task.astype(np.int64)
    rows = np.repeat(np.arange(len(task)), np.diff(robots.task_ptr))
    edge = np.full(len(task), KEEP)
    hit = np.flatnonzero(robots.task == task[rows])
    edge[rows[hit]] = hit
    task = np.where(task >= 0, edge, task)
    choices = RobotChoices(task, decisions.broadcast, decisions.query.astype(np.int64), decisions.assist)
    pick = decisions.operator.astype(np.int64)
    return choices, np.where(pick >= 0, pick + 2, np.where(pick == KEEP, 0, 1))


def join_choices(robots: list[RobotGraphs], choices: list[RobotChoices]) -> RobotChoices:
    """The choices of several steps, with edges as `join_robots` numbers them."""
    starts = np.cumsum([0] + [len(part.task) for part in robots])
    tasks = [np.where(part.task >= 0, part.task + start, part.task) for part, start in zip(choices, starts)]
    return RobotChoices(np.concatenate(tasks), *(np.concatenate(column) for column in list(zip(*choices))[1:]))


@torch.no_grad()
def value_states(critic, scale, states: States, robots, operators) -> tuple[np.ndarray, np.ndarray]:
    """(robots' [n, 2], operators' [k, 2]) values in units of reward, of agents given as (rising state, number)."""
    parts = []
    for start in range(0, len(states.robot), VALUE_CHUNK):
        chunk = States(*(torch.from_numpy(array[start : start + VALUE_CHUNK]) for array in states))
        asked = []
        for state, agent in (robots, operators):
            rows = slice(*np.searchsorted(state, [start, start + VALUE_CHUNK]))
            asked.append(Agents(torch.from_numpy(state[rows] - start), torch.from_numpy(agent[rows])))
        parts.append([scale.real(role, values).numpy() for role, values in enumerate(critic(chunk, *asked))])
    return tuple(np.concatenate(columns) for columns in zip(*parts))
