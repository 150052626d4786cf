"""dm_control's viewer loop without a window: its runtime, camera and renderer, off the screen.

    python examples/viewer_headless.py --out viewer.png

On a desktop the same is `dm_control.viewer.launch(commhg_mj.tasks.load("surveillance", "small"), policy)`.
"""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import tyro

import commhg_mj.tasks  # first: it finds an OpenGL that needs no screen

env = commhg_mj.tasks.load("surveillance", "small", {"random": 7})

from dm_control import _render  # noqa: E402
from dm_control.viewer import renderer, runtime  # noqa: E402


@dataclass(frozen=True)
class Args:
    frames: int = 400
    """of the viewer's loop; the mission's episodes follow one another"""
    seconds: float = 2.0
    """of the mission a frame"""
    width: int = 960
    """pixels"""
    height: int = 540
    """pixels"""
    out: Path = Path("runs/viewer.png")
    """the last frame"""


def policy(timestep):
    """Random open choices."""
    masks = env.task.team.choices.split(timestep.observation["action_mask"])
    return np.array([rng.choice(np.flatnonzero(mask)) for mask in masks])


def main(args: Args):
    surface = _render.Renderer(max_width=args.width, max_height=args.height)
    viewport = renderer.Viewport(args.width, args.height)
    loop = runtime.Runtime(env, policy)
    loop.simulation_time_budget = args.seconds
    shown, nobody_pushes = {}, renderer.NullPerturbation()

    def show_world():
        """A new episode is a new world, hence a new model, as the viewer's application has it."""
        shown["renderer"] = renderer.OffScreenRenderer(env.physics.model, surface)
        shown["camera"] = renderer.SceneCamera(env.physics.model, env.physics.data, renderer.RenderSettings())
        shown["camera"].set_fixed_mode(env.physics.model.name2id("overview", "camera"))

    loop.on_physics_changed += show_world
    show_world()
    episodes = 0
    for _ in range(args.frames):
        loop.tick(args.seconds, paused=False)
        shown["renderer"].render(viewport, shown["camera"].render(nobody_pushes))
        if loop.state == runtime.State.STOPPED:
            episodes += 1
            loop.restart()
    picture = shown["renderer"].pixels
    args.out.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(args.out), cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    height, width, _ = picture.shape
    print(f"{episodes} episodes ended, {env.physics.time():.0f} s into the next; {args.out}: {width}x{height}")


rng = np.random.default_rng(0)
if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
