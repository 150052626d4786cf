"""Hashes of worlds, links and missions, for tests/test_same_bits.py.

`python tests/fingerprints.py` prints them; `... > tests/fingerprints.json` commits them anew after a change of rules.
"""

import hashlib
import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from flying import fly, visible_bytes
from strategies import change

from commhg_mj.mission.trace import make_traces
from commhg_mj.models.world import make_world
from commhg_mj.policies import POLICIES, prepare
from commhg_mj.radio import LINK_MODELS
from commhg_mj.radio.world_links import WorldLinks
from commhg_mj.scenarios import SCENARIOS
from commhg_mj.scenarios.heightmap import PIXELS, read_heightmap, to_text

SHORT = change(SCENARIOS["small"], time_limit=200, shadowing=4.0)
RADIOS = {"edge": dict(profile="edge", shadowing=6.0), "radio": dict(profile="radio", foliage="weissberger")}
ROW, COLUMN = np.mgrid[:PIXELS, :PIXELS]


def rough(seed):
    """Blocks on blocks, cut at half their height; in whole numbers, as all these pictures."""
    rng = np.random.default_rng(seed)
    ground = sum(np.kron(rng.integers(0, 4 * PIXELS // n, (n, n)), np.ones((PIXELS // n,) * 2, int)) for n in (4, 8, 16, 32))
    return np.clip(2 * ground - ground.max(), 0, 255)


def disc(row, column, radius):
    return 255 * ((2 * ROW - row) ** 2 + (2 * COLUMN - column) ** 2 < 4 * radius**2)


HEIGHTMAPS = {
    "rough": rough(0), "rougher": rough(1), "mesa": disc(127, 127, 25), "mesas": disc(80, 60, 20) + disc(80, 196, 20),
    "ring": disc(90, 127, 40) - disc(90, 127, 30), "range": 200 * (abs(3 * ROW + COLUMN - 160) < 20),
}  # fmt: skip


def digest(*arrays) -> str:
    return hashlib.sha256(b"".join(visible_bytes(np.asarray(array)) for array in arrays)).hexdigest()[:16]


def world(scenario, seed=0) -> str:
    """Geometry, POIs, routes, and what rays meet."""
    made = make_world(scenario, seed)
    layout, rays = made.layout, made.rays.arrays
    places = layout.parts, layout.surfaces, layout.station, layout.operators, layout.starts
    return digest(*places, made.pois, made.poi_types, *made.routes, rays.canopies, rays.mountains)


def links(scenario) -> str:
    """What every link model says between places all over a world."""
    made, rng = make_world(scenario, 1), np.random.default_rng(0)
    ends = [WorldLinks(made).antennas(rng.uniform(0, made.layout.side, (400, 2)), 1.5 + 30 * k) for k in (0, 1)]
    models = [WorldLinks(made, model) for model in LINK_MODELS]
    return digest(*(model.between(*ends, 192.0) for model in models), *(model.to_station(ends[0], 64.0) for model in models))


def mission(policy, model) -> str:
    """The final state and the trace of two short missions."""
    batch = fly(*prepare(policy, SHORT, [3, 8], links=model, record=True))
    traces = [np.asarray(value) for trace in make_traces(batch, policy) for value in vars(trace).values()]
    twcr = [score.twcr for score in batch.scores()]
    return digest(*batch.state, *(array for array in traces if array.dtype.kind in "iuf"), twcr)


def pictures(folder) -> str:
    """What the reader of heightmaps makes of pictures of several sizes and kinds."""
    import cv2

    texts, rng = [], np.random.default_rng(0)
    for i, (size, channels, kind) in enumerate([(256, 1, "u1"), (300, 3, "u1"), (1000, 1, "u2"), (77, 4, "u2"), (384, 3, "u2")]):
        picture = rng.integers(0, np.iinfo(kind).max, (size, size, channels)).astype(kind)
        cv2.imwrite(f"{folder}/{i}.png", picture)
        texts.append(read_heightmap(f"{folder}/{i}.png"))
    return hashlib.sha256("".join(texts).encode()).hexdigest()[:16]


def all_fingerprints(folder) -> dict:
    return {
        **{f"world {name} {seed}": world(scenario, seed) for name, scenario in SCENARIOS.items() for seed in (0, 1)},
        **{f"heightmap {name}": world(change(SCENARIOS["medium"], heightmap=to_text(p / 255))) for name, p in HEIGHTMAPS.items()},
        "pictures": pictures(folder),
        "links": links(SCENARIOS["medium"]),
        **{f"links {name}": links(change(SCENARIOS["medium"], **fields)) for name, fields in RADIOS.items()},
        **{f"mission {policy} {model}": mission(policy, model) for policy in POLICIES for model in LINK_MODELS},
    }


if __name__ == "__main__":
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(all_fingerprints(folder), indent=1))
