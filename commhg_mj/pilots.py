"""Policies by name: the references, trained methods that come with the package, and files of weights."""

import hashlib
import os
from functools import lru_cache, partial
from pathlib import Path

from .mission.batch import MissionBatch
from .policies import POLICIES, PolicyInfo, ensure_compiled
from .policies.omniscient import every_second
from .radio import find_link_model
from .scenarios import SCENARIOS, Scenario, load_scenario

WEIGHTS = Path(__file__).parent / "learning" / "trained"  # <method>-<scenario>.safetensors
ENDING = ".safetensors"
DIGITS = 8  # of the checksum that tells weights of one name apart
VARIANTS = ("no-query", "random-gates")  # learning/policy.py's, named here so that torch is loaded by need alone


def find_policy(name: str) -> PolicyInfo:
    """The policy of that name: a reference, a trained method such as "commhg", or a path to weights.

    A learned one may lack something: "commhg+no-query", "commhg+random-gates".

    Raises:
      ValueError: there is none, or the file of weights is refused; the message names it.
    """
    if isinstance(name, str) and name in POLICIES:
        return POLICIES[name]
    base, variant = split_variant(name)
    if base.endswith(ENDING):
        _load(base)
        return PolicyInfo(partial(_fly_weights, base, variant), False)
    if base in trained_methods():
        return PolicyInfo(partial(_fly_trained, base, variant), False)
    raise ValueError(f"unknown policy {name!r}: use {', '.join([*POLICIES, *trained_methods()])} or a file of weights ({ENDING})")


def split_variant(name: str) -> tuple[str, str]:
    """(policy, what it lacks) of a name."""
    base, plus, variant = str(name).rpartition("+")
    return (base, variant) if plus and variant in VARIANTS else (str(name), "")


def trained_methods() -> list[str]:
    """Methods whose weights come with the package."""
    return sorted({path.name.partition("-")[0] for path in WEIGHTS.glob(f"*-*{ENDING}")})


def label_of(name: str) -> str:
    """What a policy is called in titles and names of files: weights by the run that they lie in, and their content.

    Raises:
      ValueError: a file of weights cannot be read; the message names it.
    """
    base, variant = split_variant(name)
    path, lacking = Path(base), f"+{variant}" if variant else ""
    if base.endswith(ENDING):
        base = f"{path.parent.name or path.stem}-{_digest_version(base, _version(base))}"
    return base + lacking


def prepare(name: str, scenario, seeds, links="abstract", limitation="nominal", record=False):
    """(batch, policy) for missions of a scenario; a privileged policy gets its idealised conditions."""
    info, scenario = find_policy(name), load_scenario(scenario)
    find_link_model(links)
    ensure_compiled(POLICIES.values())
    scenario, links = conditions_of(name, scenario, links)
    batch = MissionBatch(scenario, seeds, links, limitation, record)
    return batch, info.make(batch)


def conditions_of(name: str, scenario: Scenario, links: str) -> tuple[Scenario, str]:
    """(scenario, links) that a policy flies under when these are asked for."""
    return (every_second(scenario), "perfect") if find_policy(name).is_privileged else (scenario, links)


def weights_for(method: str, scenario: Scenario) -> Path:
    """The method's weights that were trained on the scenario, or on the one of the nearest size."""
    sizes = {name: abs(SCENARIOS[name].n_robots - scenario.n_robots) for name in SCENARIOS}
    for name in sorted(sizes, key=lambda name: (name != scenario.name, sizes[name])):
        path = WEIGHTS / f"{method}-{name}{ENDING}"
        if path.exists():
            return path
    raise ValueError(f"no weights of {method} come with the package")


def _fly_trained(method, variant, batch):
    return _fly_weights(str(weights_for(method, batch.scenario)), variant, batch)


def _fly_weights(path, variant, batch):
    from .learning.policy import LearnedPolicy

    return LearnedPolicy(_load(path), batch, variant=variant)


def _load(path):
    """The method of a file of weights, read anew once the file is another."""
    return _load_version(path, _version(path))


def _version(path):
    """Differs once a file is written anew."""
    stat = os.stat(path) if os.path.exists(path) else None
    return stat and (stat.st_mtime_ns, stat.st_size)


@lru_cache(maxsize=16)
def _load_version(path, version):
    import torch

    from .learning.weights import load_weights

    torch.set_num_threads(1)  # processes fly side by side, and the networks are small
    return load_weights(path)[0]


@lru_cache(maxsize=16)
def _digest_version(path, version):
    """The first digits of a checksum of a file."""
    try:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()[:DIGITS]
    except OSError as error:
        raise ValueError(f"weights {path}: {error.strerror}") from None
