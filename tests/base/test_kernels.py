"""The kernels' cache: an edited kernel is never served stale, and there is always somewhere to write."""

import ast
import importlib.util
import os
import pickle
import pwd
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numba
import pytest

from commhg_mj.base import kernels

PACKAGE = Path(kernels.__file__).parent.parent


def is_kernel(node):
    return any(isinstance(d, ast.Name) and d.id == "kernel" for d in getattr(node, "decorator_list", ()))


MODULES = {path.relative_to(PACKAGE): ast.parse(path.read_text()) for path in sorted(PACKAGE.rglob("*.py"))}
WITH_KERNELS = [path for path, tree in MODULES.items() if any(map(is_kernel, tree.body))]


def ingredients(path):
    """Modules of the package whose names a module's kernels, or its constants, use."""
    tree, used = MODULES[path], set()
    for node in tree.body:
        if is_kernel(node) or isinstance(node, (ast.Assign, ast.AnnAssign)):
            used |= {name.id for name in ast.walk(node) if isinstance(name, ast.Name)}
    for node in tree.body:
        if not isinstance(node, ast.ImportFrom) or not node.level:
            continue
        folder = PACKAGE / path.parents[node.level - 1]
        for alias in node.names:
            if (alias.asname or alias.name) in used:
                steps = (node.module or "").split(".") if node.module else []
                candidates = (folder.joinpath(*steps, alias.name), folder.joinpath(*steps))
                found = [c.with_suffix(".py") for c in candidates if c.with_suffix(".py").exists()]
                yield from (c.relative_to(PACKAGE) for c in found[:1])


SOURCES = sorted(
    {*WITH_KERNELS, *(found for path in WITH_KERNELS for found in ingredients(path))} - {Path("base/kernels.py")}
)


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    folder = tmp_path_factory.mktemp("copy") / "commhg_mj"
    shutil.copytree(PACKAGE, folder, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


@pytest.fixture
def hashed(copy, monkeypatch):
    monkeypatch.setattr(kernels, "PACKAGE", copy)
    return kernels._source_hash


def test_a_copy_elsewhere_has_the_same_hash(hashed, monkeypatch):
    there = hashed()
    monkeypatch.setattr(kernels, "PACKAGE", PACKAGE)
    assert hashed() == there == hashed()


def test_there_are_kernels_to_look_at():
    assert {Path("mission/tick.py"), Path("mission/observe.py"), Path("policies/greedy.py")} <= set(WITH_KERNELS)
    assert {Path("base/terms.py"), Path("mission/state.py")} <= set(SOURCES)


@pytest.mark.parametrize("source", SOURCES, ids=str)
def test_an_edit_of_any_kernel_or_of_its_constants_changes_the_folder(hashed, copy, source):
    before, text = hashed(), (copy / source).read_text()
    (copy / source).write_text(text + "\n# edited\n")
    try:
        assert hashed() != before
    finally:
        (copy / source).write_text(text)
    assert hashed() == before


def test_another_numba_has_another_folder(hashed, monkeypatch):
    before = hashed()
    monkeypatch.setattr(numba, "__version__", "0.0.0")
    assert hashed() != before


@pytest.fixture
def cleared(monkeypatch, tmp_path):
    """No variable names a folder; the temporary folder is empty."""
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    (tmp_path / "tmp").mkdir()
    monkeypatch.chdir(tmp_path)
    return monkeypatch


def check(folder, inside):
    assert folder.is_dir() and folder.is_absolute() and folder.is_relative_to(inside), folder
    (folder / "probe").touch()


def test_the_cache_lies_where_the_environment_says(cleared, tmp_path):
    for name, base in (("HOME", "home/.cache"), ("XDG_CACHE_HOME", "xdg"), ("NUMBA_CACHE_DIR", "numba")):
        cleared.setenv(name, str(tmp_path / (base.split("/")[0])))
        folder = kernels._cache_dir()
        check(folder, tmp_path / base)
        assert folder.name.endswith(kernels._source_hash())


def test_an_impossible_cache_folder_falls_back(cleared, tmp_path):
    (tmp_path / "file").touch()
    cleared.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    check(kernels._cache_dir(), tmp_path / "tmp")


def test_a_read_only_cache_folder_falls_back(cleared, tmp_path):
    cleared.setenv("NUMBA_CACHE_DIR", str(tmp_path / "shared"))
    access = os.access
    cleared.setattr(os, "access", lambda path, mode: "shared" not in str(path) and access(path, mode))
    check(kernels._cache_dir(), tmp_path / "tmp")
    cleared.setattr(os, "access", lambda path, mode: False)
    check(kernels._cache_dir(), tmp_path / "tmp")


def test_a_folder_of_somebody_else_is_not_trusted(cleared, tmp_path):
    """numba runs what it finds there."""
    cleared.setenv("NUMBA_CACHE_DIR", str(tmp_path / "theirs"))
    check(kernels._cache_dir(), tmp_path / "theirs")
    cleared.setattr(os, "getuid", lambda: 54321)
    check(kernels._cache_dir(), tmp_path / "tmp")


def test_a_user_without_a_home(cleared, tmp_path):
    """As in a container that runs under a number of its own."""

    def unknown(uid):
        raise KeyError(uid)

    cleared.setattr(pwd, "getpwuid", unknown)
    check(kernels._cache_dir(), tmp_path / "tmp")
    assert [path.name for path in tmp_path.iterdir()] == ["tmp"], "nothing in the present folder"


def test_numba_writes_into_that_folder():
    code = "import numba, commhg_mj.mission.tick as t; from commhg_mj.base.kernels import CACHE_DIR as c; "
    code += "assert t.advance._cache.cache_path.startswith(str(c)), t.advance._cache.cache_path"
    subprocess.run([sys.executable, "-c", code], check=True)


def load_kernels(folder, monkeypatch):
    """A kernel and a formula of a file, as another process would find them on disk: their values, and the cache's files."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(folder / "cache"))
    source = folder / "some_kernels.py"
    if not source.exists():
        source.write_text(
            "from commhg_mj.base.kernels import formula, kernel\n\n\n@kernel\ndef twice(x):\n    return 2.0 * x\n\n\n"
            "@formula\ndef thrice(x):\n    return 3.0 * x\n"
        )
    spec = importlib.util.spec_from_file_location("some_kernels", source)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.twice(4.0), module.thrice(4.0), module.twice.stats.cache_hits


def truncate(path):
    path.write_bytes(path.read_bytes()[:-9])


DAMAGES = {
    "empty": lambda path: path.write_bytes(b""), "truncated": truncate, "garbage": lambda path: path.write_bytes(b"\x80nonsense"),
    "another pickle": lambda path: path.write_bytes(pickle.dumps((1, 2, 3))),
}  # fmt: skip


@pytest.mark.parametrize("ending", ["nbi", "nbc"])
@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_files_are_told_in_one_line_and_compiled_anew(tmp_path, monkeypatch, capsys, ending, damage):
    assert load_kernels(tmp_path, monkeypatch) == (8.0, 12.0, {})
    paths = list(tmp_path.rglob(f"*.{ending}"))
    assert len(paths) == 2
    for path in paths:
        DAMAGES[damage](path)
    is_another_version = (ending, damage) == ("nbi", "another pickle")  # to numba that is no damage
    assert load_kernels(tmp_path, monkeypatch) == (8.0, 12.0, {})
    err = capsys.readouterr().err
    assert err == "" if is_another_version else err.count("\n") == 1 and str(tmp_path) in err
    value, other, hits = load_kernels(tmp_path, monkeypatch)
    assert (value, other, sum(hits.values()), capsys.readouterr().err) == (8.0, 12.0, 1, "")


def test_an_unreadable_file_is_damaged_too(tmp_path, monkeypatch, capsys):
    load_kernels(tmp_path, monkeypatch)

    def fail(*arguments):
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as broken:
        broken.setattr("numba.core.caching.IndexDataCacheFile.load", fail)
        assert load_kernels(tmp_path, monkeypatch)[:2] == (8.0, 12.0)
    assert capsys.readouterr().err.count("\n") == 1
