"""A device that is not the CPU, in Python: tensors that say so, and refuse to meet those of the CPU as a GPU's would."""

import torch
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves, tree_map
from torch.utils.backend_registration import _setup_privateuseone_for_python_backend

_setup_privateuseone_for_python_backend("far")
DEVICE = torch.device("far", 0)


class Far(torch.Tensor):
    """A tensor of the device; `near` holds its numbers."""

    @staticmethod
    def __new__(cls, near):
        layout = {"strides": near.stride(), "storage_offset": near.storage_offset(), "dtype": near.dtype}
        return torch.Tensor._make_wrapper_subclass(cls, near.shape, device=DEVICE, requires_grad=False, **layout)

    def __init__(self, near):
        self.near = near

    @classmethod
    def __torch_dispatch__(cls, operator, types, arguments=(), options=None):
        return compute(operator, arguments, options or {})


class Present(TorchDispatchMode):
    """While the device is there; counts what it computes."""

    n_operations = 0

    def __torch_dispatch__(self, operator, types, arguments=(), options=None):
        self.n_operations += any(isinstance(leaf, Far) for leaf in tree_leaves(arguments))
        return compute(operator, arguments, options or {})


def compute(operator, arguments, options):
    name = operator.overloadpacket.__name__
    tensors = [leaf for leaf in tree_leaves((arguments, options)) if isinstance(leaf, torch.Tensor)]
    far = [isinstance(tensor, Far) for tensor in tensors]
    if any(far) and name not in ("_to_copy", "copy_"):
        meets = [tensor for tensor in tensors if not isinstance(tensor, Far) and tensor.dim()]
        assert not meets, f"{operator}: tensors on two devices"
    wanted = options.get("device")
    goes_far = any(far) if wanted is None else torch.device(wanted).type == DEVICE.type
    if wanted is not None:
        options = options | {"device": torch.device("cpu")}
    near = tree_map(lambda leaf: leaf.near if isinstance(leaf, Far) else leaf, (arguments, options))
    result = operator(*near[0], **near[1])
    if name.endswith("_"):
        return arguments[0]
    return tree_map(lambda leaf: Far(leaf) if goes_far and isinstance(leaf, torch.Tensor) else leaf, result)
