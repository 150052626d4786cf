"""Commands that look into a mission: what a robot knew, and where a query changed a plan."""

from dataclasses import dataclass
from pathlib import Path

import tyro

from ..mission.trace import load_trace
from .console import OUT, check_png, load_mujoco, make_folder, say

RENDERS = Path("renders")  # where pictures go by default


@dataclass(frozen=True)
class Explain:
    """What a robot knew when it decided, beside the truth, and what its policy preferred: tables and a picture."""

    trace: tyro.conf.Positional[Path]
    """a trace file, from `run --out`; its mission is flown again"""
    robot: str
    """uav0, ugv1, ..."""
    at: float
    """the second; its last decision by then is shown"""
    policy: str | None = None
    """that flew the trace: a name or a file of weights; by default the name in the trace"""
    out: Path | None = None
    """FILE.png; by default renders/TRACE-ROBOT-SECOND.png"""

    def __call__(self):
        load_mujoco()
        from ..models.world import make_world
        from ..render.knowledge import draw_knowledge
        from ..study.knowledge import choice_words, headline, operator_sides, operator_table, peer_table, task_table
        from ..study.reflight import Reflight, last_decision

        check_png(self.out)
        trace = load_trace(self.trace)
        flight = Reflight(trace, self.policy, str(self.trace))
        decision, names = last_decision(flight, self.robot, self.at), trace.scenario.robot_names
        out = picture_path(self.out, f"{self.trace.stem}-{self.robot}-{self.at:g}.png")
        look = flight.preferences()
        preferences = look and look(decision.seen)
        say(headline(decision, names))
        OUT.print(task_table(decision, names, preferences))
        OUT.print(operator_table(decision, names, preferences))
        OUT.print(peer_table(decision, names))
        chosen = f"chose: {choice_words(decision)}"
        say(chosen)
        operators = operator_sides(decision, names)
        title = f"{self.trace.stem}, {headline(decision, names)}"
        draw_knowledge(out, make_world(trace.scenario, trace.seed), decision, preferences, title, operators, chosen)
        say(f"wrote {out}")


def picture_path(out: Path | None, name: str) -> Path:
    """Where a picture goes: `out`, or a name in the folder renders, which is made."""
    if out is None:
        make_folder(RENDERS)
    return out or RENDERS / name
