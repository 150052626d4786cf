"""The methods side by side, out of the registry (docs/learning.md, `commhg-mj methods`)."""

from torch import nn

from .registry import METHODS, About, find_method

MEASURE = "commhg"  # whose parameters the others' are held against
HEAD = ("method", *About._fields, "parameters", f"of {MEASURE}'s")


def count_parameters(module: nn.Module) -> int:
    """Numbers that are learned."""
    return sum(parameter.numel() for parameter in module.parameters())


def method_rows() -> list[tuple[str, ...]]:
    """A row for each method that comes with the package or was added, in the words of `HEAD`."""
    find_method(MEASURE)  # fills the registry
    counts = {name: count_parameters(METHODS[name]()) for name in sorted(METHODS)}
    shares = {name: f"{count / counts[MEASURE]:.2f}" for name, count in counts.items()}
    return [(name, *METHODS[name].about, f"{count:,}", shares[name]) for name, count in counts.items()]
