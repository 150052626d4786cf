"""Flying a comparison in parts that are kept: an interrupted one goes on where it stopped."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ...base import kernels
from ...base.files import whole_file
from ...flights.fly import chunks_of, fly_to_end, spread
from ...mission.trace import make_traces
from ...planning.link_pairs import links_of
from ...policies import label_of
from ...scenarios import to_json
from .message_counts import mission_record
from .plan import LINK_MISSIONS, Condition
from .sight import blockages

FORMAT = 1
PERIOD = 5  # s between the links that count; blockages are followed second by second


def claim_folder(folder: Path, settings: dict) -> None:
    """Make the folder of a comparison, or refuse one that holds another.

    Raises:
      ValueError: it holds a comparison with other settings, or something else under that name; the message says which.
    """
    path = folder / "comparison.json"
    settings = {"format": FORMAT, "kernels": kernels.CACHE_DIR.name, **settings}
    if path.exists():
        held = _read(path)
        if not isinstance(held, dict):
            raise ValueError(f"{path} is damaged: choose another --out or remove it")
        for name, value in settings.items():
            if held.get(name) != value:
                what = "was made by another version" if name in ("format", "kernels") else f"has another {name}"
                raise ValueError(f"--out {folder}: the comparison there {what}; choose another folder")
    try:
        (folder / "parts").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"--out {folder}: {error.strerror}") from None
    with whole_file(path) as part:
        part.write_text(json.dumps(settings, indent=1))


def settings_of(scenario, policies, first_seed: int, limitation: str) -> dict:
    """What two comparisons must share to share their parts; more missions may join later."""
    labels = list(map(label_of, policies))
    return {"scenario": json.loads(to_json(scenario)), "policies": labels, "seed": first_seed, "limitation": limitation}


def fly_conditions(
    folder: Path, conditions: list[Condition], first_seed: int, limitation: str, workers: int, advance: Callable[[int], None]
) -> dict[str, list[dict]]:
    """The mission records of every condition, by label; only parts that the folder lacks are flown."""
    jobs = {}
    for condition in conditions:
        seeds = range(first_seed, first_seed + condition.missions)
        jobs[condition.label] = [
            (_part(folder, condition.label, chunk), condition, chunk, limitation) for chunk in chunks_of(seeds)
        ]
    todo = _missing([job for each in jobs.values() for job in each], _read, lambda job: advance(len(job[2])))
    spread(_fly_part, todo, workers, advance)
    return {label: [record for job in each for record in _read(job[0]) or ()] for label, each in jobs.items()}


def _missing(jobs, read, tell):
    """The jobs whose part, their first argument, is not there or damaged; the others are told of."""
    todo = []
    for job in jobs:
        if read(job[0]) is None:
            todo.append(job)
        else:
            tell(job)
    return todo


def _part(folder, label, seeds) -> Path:
    name = "".join(letter if letter.isalnum() else "-" for letter in label)
    return folder / "parts" / f"{name}-{seeds[0]}-{len(seeds)}.json"


def _read(path):
    """What a JSON file holds; None where there is none or it is damaged."""
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError):
        return None


def _fly_part(path, condition, seeds, limitation) -> int:
    """Fly some missions of a condition and keep their records; returns how many."""
    batch = fly_to_end(condition.policy, condition.scenario, seeds, condition.links, limitation, record=True)
    traces = make_traces(batch, condition.policy)
    records = [mission_record(score, trace) for score, trace in zip(batch.scores(), traces)]
    with whole_file(path) as part:
        part.write_text(json.dumps(records))
    return len(seeds)


def look_at_links(
    folder: Path, condition: Condition, first_seed: int, limitation: str, workers: int, advance: Callable[[int], None]
) -> tuple[np.ndarray, np.ndarray]:
    """(links [n] PAIR in range every PERIOD seconds, blockages [m] BLOCKAGE) along a condition's first missions."""
    seeds = range(first_seed, first_seed + link_missions(condition))
    jobs = [(folder / "parts" / f"links-{seed}.npz", condition, seed, limitation) for seed in seeds]
    spread(_look_part, _missing(jobs, _read_links, lambda job: advance(1)), workers, advance)
    found = [read for read in (_read_links(job[0]) for job in jobs) if read]
    return np.concatenate([links for links, _ in found]), np.concatenate([blocked for _, blocked in found])


def link_missions(condition: Condition) -> int:
    """How many missions `look_at_links` flies."""
    return min(condition.missions, LINK_MISSIONS)


def _read_links(path):
    try:
        with np.load(path, allow_pickle=False) as file:
            return file["links"], file["blockages"]
    except Exception:  # whatever zipfile, zlib and numpy say of what is missing or damaged: it is flown anew
        return None


def _look_part(path, condition, seed, limitation) -> int:
    batch = fly_to_end(condition.policy, condition.scenario, [seed], condition.links, limitation, record=True)
    links = links_of(make_traces(batch, condition.policy)[0])
    links = links[links["in_range"]]
    with whole_file(path) as part, open(part, "wb") as file:
        np.savez_compressed(file, links=links[links["time"] % PERIOD == 0], blockages=blockages(links))
    return 1
