"""Trained weights: one safetensors file that says what it holds; loading executes no code."""

import json

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from ..base.arguments import path_of
from ..base.files import whole_file
from .features import PLAN, PLAN_EDGE
from .registry import Method, make_method
from .state_features import ALL_GROUPS

FORMAT = "commhg_mj weights 4"  # counts on with the rules that weights are trained under
OF_CRITIC = "critic.", "scale."  # what its tensors' names begin with; nothing in flight needs them
SCHEMA = {group.title: group.names for group in ALL_GROUPS}  # what each column is
OF_PLANS = PLAN.title, PLAN_EDGE.title  # whose columns matter to who reads them alone


def save_weights(method, path, facts: dict, with_critic=True) -> None:
    """Write a method's weights with facts about their training, whole or not at all."""
    kept = {
        name: tensor.contiguous() for name, tensor in method.state_dict().items() if with_critic or not name.startswith(OF_CRITIC)
    }
    has_plans = method.plan is not None
    schema = read_by(SCHEMA, has_plans)
    schema = {title: names for title, names in schema.items() if with_critic or not title.startswith("state: ")}
    metadata = {
        "format": FORMAT, "method": method.name, "plans": json.dumps(has_plans), "schema": json.dumps(schema),
        "facts": json.dumps(facts),
    }  # fmt: skip
    with whole_file(path) as draft:
        draft.write_bytes(save(kept, metadata))  # its own writer lets nobody else read the file


def read_by(schema: dict, has_plans: bool) -> dict:
    """The part of a schema that a method reads."""
    return {title: names for title, names in schema.items() if has_plans or title not in OF_PLANS}


def _object(path, text, what) -> dict:
    """A JSON object of the file's."""
    try:
        found = json.loads(text)
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise ValueError(f"{path}: {what} are no JSON object")
    return found


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
    has_plans = metadata.get("plans") == "true"
    schema = read_by(_object(path, metadata.get("schema", ""), "its columns"), has_plans)
    if not schema or any(SCHEMA.get(title) != names for title, names in schema.items()):
        raise ValueError(f"{path} was trained with other features than this version has")
    try:
        with torch.random.fork_rng(devices=[]):  # what a network begins with is drawn, and replaced at once
            method = make_method(metadata.get("method"), has_plans)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    facts = _object(path, metadata.get("facts", ""), "its facts")
    for name, tensor in tensors.items():
        if not torch.isfinite(tensor).all():
            raise ValueError(f"weights {path}: {name} holds a number that is not finite")
    if not any(name.startswith(OF_CRITIC) for name in tensors):  # published without; training on begins with a new one
        tensors |= {name: tensor for name, tensor in method.state_dict().items() if name.startswith(OF_CRITIC)}
    try:
        method.load_state_dict(tensors)
    except RuntimeError as error:
        raise ValueError(f"{path} does not fit {method.name}: {str(error).splitlines()[-1].strip()}") from None
    return method.eval(), facts
