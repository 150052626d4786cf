"""The whole team as one Gymnasium agent."""

from typing import TYPE_CHECKING

import gymnasium
import numpy as np
from gymnasium import spaces

from ..base.arguments import check_seed, said
from .registration import PlainSpec
from .spaces import team_space
from .team import Team

if TYPE_CHECKING:
    from ..render.live import LiveFilm

RENDER_FPS = 12


class MissionEnv(PlainSpec, gymnasium.Env):
    """A mission, stepped to the next decision epoch of anybody.

    Observations, actions and masks: docs/tasks.md. A masked choice counts as staying (`info["replaced"]` counts them).
    The reward is the team's since the last step; after `info["elapsed"]` seconds a discount per second γ is γ ** elapsed.

    Args:
      scenario: name, TOML file, `Scenario` or its table.
      render_mode: None, or "rgb_array".
      camera, size: of rendered pictures: overview, station, map, orbit or follow:ROBOT; (width, height) in pixels.
      record: keep what `commhg_mj.make_traces(env.unwrapped.team.batch, name)` needs; rendering does.
      options: of `commhg_mj.tasks.Team`: links, limitation, period, seeds.

    Raises:
      ValueError: an argument is impossible; the message names it.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": RENDER_FPS}

    def __init__(self, scenario="medium", render_mode=None, camera="overview", size=(960, 540), record=False, **options):
        check_render_mode(render_mode, self.metadata)
        self.render_mode = render_mode
        self.team = Team(scenario, record=record if render_mode is None else True, **options)
        self._film = make_film(self.team, render_mode, camera, size)
        self.observation_space = team_space(self.team.scenario, self.team.choices)
        self.action_space = spaces.MultiDiscrete(self.team.choices.sizes)

    def reset(self, *, seed=None, options=None) -> tuple[dict, dict]:
        """A new mission: of that seed, or the next one that the last seed leads to. There are no options."""
        seed = None if seed is None else check_seed(seed)
        super().reset(seed=seed)
        self.team.begin([self.team.draw_seed(self.np_random) if seed is None else seed])
        return self._observe(), self._inform()

    def step(self, action) -> tuple[dict, float, bool, bool, dict]:
        """Decide, and advance to the next decision epoch."""
        self.team.step(action, alone=True)
        return self._observe(), float(self.team.rewards[0]), bool(self.team.over[0]), False, self._inform()

    def action_masks(self) -> np.ndarray:
        """All choices' masks in one [n] bool, as MaskablePPO of sb3-contrib asks for them. ResetNeeded before the first reset."""
        self.team.check_begun()
        return self.team.mask[0].astype(bool)

    def render(self) -> np.ndarray | None:
        """The mission as it stands [height, width, 3] u1; None without a render mode. ResetNeeded before the first reset."""
        if self._film is None:
            return None
        return self._film.picture(self.team.batch)

    def close(self) -> None:
        if self._film:
            self._film.close()

    def _observe(self):
        return {name: array[0].copy() for name, array in observe_teams(self.team).items()}

    def _inform(self):
        team = self.team
        info = {name: values[0].item() for name, values in inform_teams(team).items()}
        info["action_mask"] = team.choices.split(team.mask[0].copy())
        return info | team.score()


def observe_teams(team: Team) -> dict:
    """Views of what all teams see, by the names of `team_space`."""
    rest = {"due": team.due, "action_mask": team.mask}
    seconds = {name: getattr(team, name)[:, None].astype(np.float32) for name in ("time", "elapsed")}
    return team.tables._asdict() | rest | seconds


def inform_teams(team: Team) -> dict:
    """What the last step was, one array [E] a name; `mission_reward` and `coordination_reward` add up to the reward."""
    mission, coordination = team.batch.rewards.T
    return {
        "seed": np.array(team.batch.seeds),
        "time": team.time,
        "elapsed": team.elapsed,
        "replaced": team.replaced,
        "mission_reward": mission,
        "coordination_reward": coordination,
    }


def make_film(team: Team, render_mode, camera, size) -> "LiveFilm | None":
    """What takes pictures of a recording team; without a render mode None, and MuJoCo is not loaded either."""
    if render_mode is None:
        return None
    from ..render.live import LiveFilm

    return LiveFilm(team.scenario, camera, size)


def check_render_mode(render_mode, metadata) -> None:
    """ValueError unless the mode is None or known."""
    modes = metadata["render_modes"]
    if render_mode is not None and not (isinstance(render_mode, str) and render_mode in modes):
        raise ValueError(f"render_mode must be None{''.join(f' or {mode!r}' for mode in modes)}, is {said(render_mode)}")
