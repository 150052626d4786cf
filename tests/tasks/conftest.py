"""Before any test imports dm_control: pictures without a screen."""

import commhg_mj.tasks  # noqa: F401
