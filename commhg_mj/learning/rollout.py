"""One rollout for every method: fly, decide, remember what an update needs."""

from typing import NamedTuple

import numpy as np
import torch

from ..mission.batch import MissionBatch
from ..mission.decide import Decisions
from ..policies.schedule import follow_schedule
from ..terms import KEEP, REST
from .advantage import estimate_advantages
from .batches import join_operators, join_robots, operator_batch, robot_batch
from .graphs import GraphBuilder, OperatorGraphs, RobotGraphs
from .heads import RobotChoices, choose_operators, choose_robots
from .states import States, read_states

VALUE_CHUNK = 2048  # states


class Experience(NamedTuple):
    """Decisions of N robots and K operators in S states, in the order of states."""

    states: States
    robots: RobotGraphs  # `mission` is the row of `public`
    operators: OperatorGraphs
    public: np.ndarray  # [worlds, T, N_PUBLIC]
    robot_choices: RobotChoices
    operator_choices: np.ndarray  # [K] i8
    robot_state: np.ndarray  # [N] i8 rising
    operator_state: np.ndarray  # [K] i8 rising
    robot_advantage: np.ndarray  # [N, 2] mission, coordination
    operator_advantage: np.ndarray  # [K, 2]
    robot_return: np.ndarray  # [N, 2]
    operator_return: np.ndarray  # [K, 2]


class Pilot:
    """Decides for all who are due by a method's actors."""

    def __init__(self, method, builder: GraphBuilder):
        self.method, self.builder = method, builder

    @torch.no_grad()
    def decide(self, seen, public, rng, is_greedy=False):
        """(robot graphs, operator graphs, robots' choices, operators' choices, decisions).

        Args:
          public: [worlds, T, N_PUBLIC]; `seen`'s missions are its rows.
        """
        robots, operators = self.builder.robots(seen), self.builder.operators(seen)
        choices = RobotChoices(*(np.zeros(0, kind) for kind in (int, bool, int, bool)))
        if len(robots.itself):
            logits = self.method.robot(
                robot_batch(robots, public.shape[1]), torch.from_numpy(public.reshape(-1, public.shape[2]))
            )
            choices = choose_robots(logits, robots, rng, is_greedy)
        operator_choices = np.zeros(0, np.int64)
        if len(operators.itself):
            legal = np.concatenate([operators.keep_rest, operators.legal], axis=1)
            operator_choices = choose_operators(self.method.operator(operator_batch(operators)), legal, rng, is_greedy)
        decisions = to_decisions(robots, choices, operator_choices)
        if not self.method.communicates:
            follow_schedule(seen, decisions)
        return robots, operators, choices, operator_choices, decisions


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
        self.pilot = Pilot(self.method, self.builder)
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

    def collect(self, n_decisions: int, critic, scale, gamma, lam, teacher=None) -> Experience:
        """At least so many robot decisions; a `teacher` policy may make them, whose choices are then remembered."""
        steps, batch = [], self.batch
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
            robots, operators, choices, picks, decisions = self.pilot.decide(seen, self.public, self.rng)
            if teacher is not None:
                decisions = teacher(seen)
                choices, picks = from_decisions(robots, operators, decisions)
            missions = np.flatnonzero(~over)
            state_of = np.cumsum(~over) - 1
            states = read_states(batch, self.builder.scale[0], missions)
            batch.step_legal(decisions)
            at = (robots.mission, robots.robot), (operators.mission, batch.scenario.n_robots + operators.operator)
            robots_in, operators_in = state_of[robots.mission], state_of[operators.mission]
            robots = robots._replace(mission=world_of[robots.mission])
            after = batch.rewards, batch.time - time, batch.over
            steps.append((states, robots, operators, choices, picks, robots_in, operators_in, at, *after))
            n += len(robots.itself)
        return self._experience(steps, np.concatenate(worlds), critic, scale, gamma, lam)

    def _experience(self, steps, public, critic, scale, gamma, lam):
        states, robots, operators, choices, picks, robots_in, operators_in, at, rewards, elapsed, over = zip(*steps)
        starts = np.cumsum([0] + [len(part.robot) for part in states])
        robot_state = np.concatenate([part + start for part, start in zip(robots_in, starts)])
        operator_state = np.concatenate([part + start for part, start in zip(operators_in, starts)])
        joined = States(*(np.concatenate(arrays) for arrays in zip(*states)))
        edge_starts = np.cumsum([0] + [len(part.task) for part in robots])
        tasks = [np.where(c.task >= 0, c.task + start, c.task) for c, start in zip(choices, edge_starts)]
        columns = [np.concatenate(tasks)] + [np.concatenate([c[i] for c in choices]) for i in (1, 2, 3)]
        all_robots, all_operators = join_robots(robots), join_operators(operators)
        values = value_states(critic, scale, joined)
        robot_values = values[0][robot_state, all_robots.robot]
        operator_values = values[1][operator_state, all_operators.operator]
        batch = self.batch
        last = value_states(critic, scale, read_states(batch, self.builder.scale[0], np.arange(len(batch.seeds))))
        last = np.concatenate(last, axis=1) * ~batch.over[:, None, None]
        robot_cuts = np.cumsum([len(part.itself) for part in robots])[:-1]
        operator_cuts = np.cumsum([len(part.itself) for part in operators])[:-1]
        both = [
            np.concatenate(pair) for pair in zip(np.split(robot_values, robot_cuts), np.split(operator_values, operator_cuts))
        ]
        rows = [tuple(np.concatenate(pair) for pair in zip(*two)) for two in at]
        advantages = estimate_advantages(both, rows, np.array(rewards), np.array(elapsed), np.array(over), last, gamma, lam)
        n_robots = [len(part.itself) for part in robots]
        robot_advantage = np.concatenate([part[:k] for part, k in zip(advantages, n_robots)])
        operator_advantage = np.concatenate([part[k:] for part, k in zip(advantages, n_robots)])
        return Experience(
            joined, all_robots, all_operators, public, RobotChoices(*columns), np.concatenate(picks), robot_state, operator_state,
            robot_advantage, operator_advantage, robot_advantage + robot_values, operator_advantage + operator_values,
        )  # fmt: skip


def from_decisions(robots: RobotGraphs, operators: OperatorGraphs, decisions: Decisions):
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


@torch.no_grad()
def value_states(critic, scale, states: States) -> tuple[np.ndarray, np.ndarray]:
    """(robots' [S, R, 2], operators' [S, H, 2]) values in units of reward."""
    parts = []
    for start in range(0, len(states.robot), VALUE_CHUNK):
        chunk = States(*(torch.from_numpy(array[start : start + VALUE_CHUNK]) for array in states))
        parts.append([scale.real(role, values).numpy() for role, values in enumerate(critic(chunk))])
    return tuple(np.concatenate(columns) for columns in zip(*parts))
