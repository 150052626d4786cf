"""A short side-by-side video of one mission under both models, around the first decision that differs."""

from pathlib import Path

from ...flights.fly import fly_to_end
from ...mission.trace import make_traces
from ...scenarios import Scenario

BEFORE, AFTER = 20.0, 130.0  # s of the mission around the decision
SIZE, FPS, SPEED = (640, 360), 15, 12.0


def make_clip(folder: Path, scenario: Scenario, policy: str, seed: int, limitation: str) -> Path:
    """Render the clip; an existing one is kept. Returns its path."""
    from ...render import first_divergence, render_video

    path = folder / f"side-{seed}.mp4"
    if not path.exists():
        left, right = (
            make_traces(fly_to_end(policy, scenario, [seed], links, limitation, record=True), policy)[0]
            for links in ("abstract", "raycast")
        )
        parted = first_divergence(left, right)
        last = float(max(left.ticks, right.ticks))
        start = min(max(0.0, (parted.second if parted else 0.0) - BEFORE), last)
        stop = min(last, start + BEFORE + AFTER)
        render_video((left, right), path, "map", SIZE, FPS, SPEED, start, stop)
    return path
