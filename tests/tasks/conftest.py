"""Pictures without a screen: dm_control asks for one unless it is told otherwise before its import."""

from commhg_mj.render.gl import choose_backend

choose_backend()
