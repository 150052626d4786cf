"""Learned policies by name: trained methods that come with the package, and files of weights. torch is loaded by need."""

import hashlib
import os
from collections.abc import Callable
from functools import lru_cache, partial
from pathlib import Path

from ..policies import SOURCES, PolicyInfo, Source
from ..scenarios import SCENARIOS, Scenario

WEIGHTS = Path(__file__).parent / "trained"  # NAME-SCENARIO.safetensors
BY_ROLLOUTS = "-rollouts"  # ends the name of a method whose weights were learned by rollouts
ENDING = ".safetensors"
DIGITS = 8  # of the checksum that tells weights of one name apart
VARIANTS = ("no-query", "random-gates", "drawn")  # learned_policy.py's, named here so that torch is loaded by need alone


def find_learned(name: str) -> PolicyInfo | None:
    """The policy of a trained method or of a file of weights; None for other names.

    Raises:
      ValueError: the file of weights is refused; the message names it.
    """
    base, variant = split_variant(name)
    if base.endswith(ENDING):
        return PolicyInfo(partial(_fly_weights, base, variant), flown_in=_conditions(_load(base)))
    if base in trained_methods():
        any_of_them = _load(str(next(WEIGHTS.glob(f"{base}-*{ENDING}"))))
        return PolicyInfo(partial(_fly_trained, base, variant), flown_in=_conditions(any_of_them))
    return None


def split_variant(name: str) -> tuple[str, str]:
    """(policy, what it lacks) of a name."""
    base, plus, variant = str(name).rpartition("+")
    return (base, variant) if plus and variant in VARIANTS else (str(name), "")


def trained_methods() -> list[str]:
    """Names of the weights that come with the package."""
    return sorted({path.stem.rpartition("-")[0] for path in WEIGHTS.glob(f"*-*{ENDING}")})


def label_learned(name: str) -> str | None:
    """Weights by the run that they lie in, and their content; None for other names.

    Raises:
      ValueError: a file of weights cannot be read; the message names it.
    """
    base, variant = split_variant(name)
    if not base.endswith(ENDING):
        return None
    path, lacking = Path(base), f"+{variant}" if variant else ""
    return f"{path.parent.name or path.stem}-{_digest_version(base, _version(base))}{lacking}"


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
    from .learned_policy import LearnedPolicy

    return LearnedPolicy(_load(path), batch, variant=variant)


def _conditions(method) -> Callable[[Scenario], Scenario]:
    """`PolicyInfo.flown_in` of a method."""
    from .first_targets import flown_in

    return partial(flown_in, method)


def _load(path):
    """The method of a file of weights, read anew once the file is another."""
    return _load_version(path, _version(path))


def _version(path):
    """Differs once a file is written anew."""
    stat = os.stat(path) if os.path.exists(path) else None
    return stat and (stat.st_mtime_ns, stat.st_size)


@lru_cache(maxsize=16)
def _load_version(path, version):
    from .weights import load_weights

    return load_weights(path)[0]


@lru_cache(maxsize=16)
def _digest_version(path, version):
    """The first digits of a checksum of a file."""
    try:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()[:DIGITS]
    except OSError as error:
        raise ValueError(f"weights {path}: {error.strerror}") from None


ALSO = f", a trained method or weights ({ENDING})"
SOURCES.append(Source(find_learned, label_learned, ALSO))
