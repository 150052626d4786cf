"""Link models."""

from .custom import link_model
from .rules import LINK_MODELS, LinkModel, find_link_model

__all__ = ["LINK_MODELS", "LinkModel", "find_link_model", "link_model"]
