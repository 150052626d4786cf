"""Worlds, links, missions and reference policies are the same bits on every processor.

Golden hashes are computed anew in processes whose libraries believe in another processor. A change of rules changes them:
`python tests/fingerprints.py > tests/fingerprints.json`.
"""

import json
import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest
from fingerprints import all_fingerprints
from numpy._core import _multiarray_umath as processor

FINGERPRINTS = Path(__file__).parent / "fingerprints.py"
GOLDEN = json.loads(FINGERPRINTS.with_suffix(".json").read_text())
HERE = {name for name, is_here in processor.__cpu_features__.items() if is_here}
OLD_NUMPY = {"NPY_DISABLE_CPU_FEATURES": ",".join(HERE & set(processor.__cpu_dispatch__))}
OLD_SYSTEM = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX2,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable"}
OLD_OPENCV = {"OPENCV_CPU_DISABLE": "AVX512-SKX,AVX2,FMA3,AVX,SSE4.2,SSE4.1"}
PROCESSORS = {
    "an old one": {"OPENBLAS_CORETYPE": "Nehalem", **OLD_NUMPY, **OLD_SYSTEM, **OLD_OPENCV},
    "one with AVX2": {"OPENBLAS_CORETYPE": "Haswell", "NPY_DISABLE_CPU_FEATURES": ",".join(HERE & {"X86_V4", "AVX512_ICL"})},
    "one with AVX-512": {"OPENBLAS_CORETYPE": "SkylakeX"},
}
NEEDS = {"one with AVX2": "AVX2", "one with AVX-512": "AVX512_SKX"}


# Elsewhere MuJoCo's library is compiled otherwise, and a ray's last bits with it.
EXPECTED = {name: value for name, value in GOLDEN.items() if platform.machine() == "x86_64" or not name.startswith("links")}


def expected_of(found):
    return {name: value for name, value in found.items() if name in EXPECTED}


def fingerprints(variables):
    settings = {name: value for name, value in variables.items() if value}
    run = subprocess.run([sys.executable, FINGERPRINTS], env=os.environ | settings, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return expected_of(json.loads(run.stdout))


def test_the_same_bits_on_this_processor(tmp_path):
    assert expected_of(all_fingerprints(tmp_path)) == EXPECTED


@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.slow if "AVX2" in name else ()) for name in PROCESSORS])
def test_the_same_bits_on_another_processor(name):
    if name in NEEDS and NEEDS[name] not in HERE:
        pytest.skip(f"this processor has no {NEEDS[name]}: such kernels would end it")
    assert fingerprints(PROCESSORS[name]) == EXPECTED


@pytest.mark.slow  # every kernel is compiled once more
def test_the_same_bits_from_kernels_for_any_processor():
    assert fingerprints(PROCESSORS["an old one"] | {"NUMBA_CPU_NAME": "generic"}) == EXPECTED
