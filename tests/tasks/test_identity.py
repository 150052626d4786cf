"""One mission behind every interface: the same decisions give the same state, rewards, tables and masks, bit by bit."""

import numpy as np
import pytest
from flying import fingerprint
from playing import BRIEF, BRITTLE, LONELY, Dice, Ledger, decisions_of
from strategies import change

from commhg_mj.mission.batch import MissionBatch
from commhg_mj.radio import LINK_MODELS
from commhg_mj.scenarios import LIMITATIONS, SCENARIOS
from commhg_mj.tasks import MissionEnv, MissionVectorEnv, parallel_env
from commhg_mj.tasks.columns import COLUMNS
from commhg_mj.tasks.surveillance import make

SEED = 5


class Gymnasium:
    def __init__(self, scenario, **options):
        self.env = MissionEnv(scenario, **options)
        self.seen, _ = self.env.reset(seed=SEED)

    def step(self, action):
        self.seen, self.reward, self.is_over, _, _ = self.env.step(action)

    @property
    def team(self):
        return self.env.team

    def tables(self):
        return {name: self.seen[name] for name in COLUMNS}

    def due(self):
        return self.seen["due"]

    def mask(self):
        return self.seen["action_mask"]


class Vector(Gymnasium):
    """The second of three missions."""

    def __init__(self, scenario, **options):
        self.env = MissionVectorEnv(3, scenario, **options)
        seen, _ = self.env.reset(seed=[1, SEED, 9])
        self.seen = {name: array[1] for name, array in seen.items()}

    def step(self, action):
        seen, rewards, over, _, _ = self.env.step(np.stack([0 * action, action, 0 * action]))
        self.seen, self.reward, self.is_over = {name: array[1] for name, array in seen.items()}, rewards[1], over[1]


class Control(Gymnasium):
    def __init__(self, scenario, **options):
        self.env = make(scenario, random=SEED, pictures=False, **options)
        self.seen = self.env.reset().observation

    def step(self, action):
        timestep = self.env.step(action)
        self.seen, self.reward, self.is_over = timestep.observation, timestep.reward, timestep.last()

    @property
    def team(self):
        return self.env.task.team

    def tables(self):
        return {name: np.stack([self.seen[name][c] for c in columns], axis=-1) for name, columns in COLUMNS.items()}

    def due(self):
        return np.concatenate([self.seen["robots"]["due"], self.seen["operators"]["due"]])


class PettingZoo(Gymnasium):
    """Rows of robots that have failed are gone: they are taken from the team."""

    def __init__(self, scenario, **options):
        self.env = parallel_env(scenario, **options)
        self.seen, self.infos = self.env.reset(seed=SEED)
        self.agents = self.env.possible_agents

    def step(self, action):
        robots = np.split(action[: 3 * self.team.scenario.n_robots], self.team.scenario.n_robots)
        choices = dict(zip(self.agents, [*robots, *action[3 * self.team.scenario.n_robots :]]))
        self.seen, rewards, terminations, _, self.infos = self.env.step({agent: choices[agent] for agent in self.env.agents})
        (self.reward,) = set(rewards.values())
        self.is_over = all(terminations.values())

    def tables(self):
        tables = {name: table[0].copy() for name, table in self.team.tables._asdict().items()}
        for i, agent in enumerate(self.agents):
            if agent in self.seen:
                own = self.seen[agent]["observation"]
                row = i if "peers" in own else i - self.team.scenario.n_robots
                names = {"tasks": "robot_tasks", "peers": "robot_peers", "operators": "robot_operators"}
                names |= {"reports": "operator_reports", "own": "robots" if "peers" in own else "operators"}
                for part, table in own.items():
                    tables[names[part]][row] = table
        return tables

    def due(self):
        return np.array([agent in self.infos and self.infos[agent]["due"] for agent in self.agents])

    def mask(self):
        masks = self.team.choices.split(self.team.mask[0].copy())
        for i, agent in enumerate(self.agents):
            if agent in self.seen:
                first, own = 3 * min(i, self.team.scenario.n_robots) + max(0, i - self.team.scenario.n_robots), self.seen[agent]
                own = own["action_mask"] if "peers" in own["observation"] else (own["action_mask"],)
                for mask, shown in zip(masks[first:], own):
                    mask[:] = shown
        return np.concatenate(masks)


def compare(scenario, most_steps=10_000, **options):
    """Fly the batch and every interface side by side, with actions of which some are masked."""
    period = options.pop("period", 0)
    batch, ledger = MissionBatch(scenario, [SEED], **options), Ledger(1, scenario)
    ledger.note(batch.observations)
    faces = [Face(scenario, period=period, **options) for Face in (Gymnasium, Vector, Control, PettingZoo)]
    dice, steps = Dice(scenario), 0
    while True:
        for face in faces:
            for name, table in face.tables().items():
                np.testing.assert_array_equal(table, getattr(ledger.tables, name)[0], f"{face} {name}", strict=True)
            np.testing.assert_array_equal(face.due(), ledger.due[0], str(face))
            np.testing.assert_array_equal(face.mask(), ledger.mask[0], str(face))
        if batch.over[0] or steps == most_steps:
            break
        action = dice.any() if steps % 4 == 0 else dice.open(ledger.mask[0])
        ledger.note(batch.step(decisions_of(batch.observations, [action]), period))
        for face in faces:
            face.step(action)
            assert (face.reward, face.is_over) == (batch.rewards[0].sum(), batch.over[0]), face
            assert face.team.time[face.team.batch.seeds.index(SEED)] == batch.time[0]
        steps += 1
    for face in faces:
        e = face.team.batch.seeds.index(SEED)
        assert fingerprint(face.team.batch.state, slice(e, e + 1)) == fingerprint(batch.state), face
    return batch


@pytest.mark.parametrize("scenario", [BRIEF, BRITTLE, LONELY], ids=["brief", "brittle", "lonely"])
def test_every_interface_flies_the_same_mission(scenario):
    batch = compare(scenario)
    assert batch.over[0] and batch.state.counters["attempted"].sum() > 0


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_of_every_scenario(scenario):
    compare(SCENARIOS[scenario], most_steps=25)


@pytest.mark.parametrize("links", LINK_MODELS)
def test_with_every_link_model(links):
    compare(change(BRIEF, time_limit=30), links=links, limitation=LIMITATIONS[list(LINK_MODELS).index(links) % len(LIMITATIONS)])


@pytest.mark.parametrize("period", [1, 7, 100])
def test_in_steps_of_fixed_seconds(period):
    compare(BRIEF, period=period)
