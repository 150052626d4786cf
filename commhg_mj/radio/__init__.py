"""Link models."""

from .custom import link_model
from .link_models import LINK_MODELS, LinkModel, find_link_model

__all__ = ["LINK_MODELS", "LinkModel", "find_link_model", "link_model"]
