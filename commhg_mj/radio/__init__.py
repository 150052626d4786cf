"""Link models."""

from .custom import link_model
from .link_models import DEFAULT_LINKS, LINK_MODELS, LinkModel, find_link_model

__all__ = ["DEFAULT_LINKS", "LINK_MODELS", "LinkModel", "find_link_model", "link_model"]
