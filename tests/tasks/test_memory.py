"""Memory stays flat over missions that come once."""

import gc
import os
import subprocess
import sys
import weakref

import pytest

from commhg_mj import WorldLinks
from commhg_mj.models.raymodel import RayModel
from commhg_mj.models.world import kept_world, make_world
from commhg_mj.scenarios import SCENARIOS

SMALL = SCENARIOS["small"]
GROWTH = """
import os, sys
import commhg_mj, gymnasium

def resident():
    return int(open("/proc/self/statm").read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6

def missions(n):
    for _ in range(n):
        env.reset()
    return resident()

env = {env}
print(-missions({warm}) + missions({more}))
"""
PICTURED = "commhg_mj.tasks.load('surveillance', 'small', {'random': 1})"
RAYCAST = "gymnasium.make('commhg_mj/Surveillance-small-v0', links='raycast')"


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="reads Linux's count of pages")
@pytest.mark.parametrize(
    "env, warm, more, bound", [(RAYCAST, 5, 20, 12), pytest.param(PICTURED, 10, 10, 100, marks=pytest.mark.slow)]
)
def test_a_process_does_not_grow_with_its_missions(env, warm, more, bound):
    code = GROWTH.format(env=env, warm=warm, more=more)
    found = subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.PIPE, text=True)
    assert float(found.stdout) < bound, "MB"


def test_a_ray_model_goes_with_the_users_of_a_world_that_comes_once():
    kept_world.cache_clear()
    links = WorldLinks(make_world(SMALL, 11), "raycast")
    assert links.world is make_world(SMALL, 11), "one object for all users at a time"
    rays = weakref.ref(links.world.rays)
    del links
    gc.collect()
    assert rays() is None
    again = make_world(SMALL, 11).rays
    assert again is make_world(SMALL, 11).rays, "what comes again stays"


def test_a_ray_model_takes_little():
    rays = RayModel(make_world(SCENARIOS["large"], 1).layout)
    assert rays.data.narena + rays.data.nbuffer < 1e6, "bytes"
