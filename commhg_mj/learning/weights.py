"""Trained weights: one safetensors file that says what it holds; loading executes no code."""

import json

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from ..base.arguments import path_of
from ..base.files import whole_file
from .features import GROUPS
from .registry import Method, find_method

FORMAT = "commhg_mj weights 3"  # counts on with the rules that weights are trained under
SCHEMA = json.dumps({group.title: group.names for group in GROUPS})  # what each column was


def save_weights(method, path, facts: dict) -> None:
    """Write a method's weights with facts about their training, whole or not at all."""
    tensors = {name: tensor.contiguous() for name, tensor in method.state_dict().items()}
    metadata = {"format": FORMAT, "method": method.name, "schema": SCHEMA, "facts": json.dumps(facts)}
    with whole_file(path) as draft:
        draft.write_bytes(save(tensors, metadata))  # its own writer lets nobody else read the file


def _facts(path, text) -> dict:
    """What the file says of the training."""
    try:
        facts = json.loads(text)
    except ValueError:
        facts = None
    if not isinstance(facts, dict):
        raise ValueError(f"{path}: its facts are no JSON object")
    return facts


def load_weights(path) -> tuple[Method, dict]:
    """(method, facts) of a file that `save_weights` wrote.

    Raises:
      ValueError: it is missing, damaged, of another format, of unknown features or of an unknown method; names the file.
    """
    path = path_of("path", path)
    try:
        with safe_open(path, "pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118  no mapping
    except (OSError, SafetensorError) as error:
        raise ValueError(f"weights {path}: {str(error).splitlines()[0]}") from None
    if metadata.get("format") != FORMAT:
        raise ValueError(f"{path} holds no weights of this version and its rules ({FORMAT}), but {metadata.get('format')}")
    if metadata.get("schema") != SCHEMA:
        raise ValueError(f"{path} was trained with other features than this version has")
    try:
        with torch.random.fork_rng(devices=[]):  # what a network begins with is drawn, and replaced at once
            method = find_method(metadata.get("method"))()
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    facts = _facts(path, metadata.get("facts", ""))
    for name, tensor in tensors.items():
        if not torch.isfinite(tensor).all():
            raise ValueError(f"weights {path}: {name} holds a number that is not finite")
    try:
        method.load_state_dict(tensors)
    except RuntimeError as error:
        raise ValueError(f"{path} does not fit {method.name}: {str(error).splitlines()[-1].strip()}") from None
    return method.eval(), facts
