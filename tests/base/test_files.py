"""Files appear whole or not at all, and destroy nothing but an earlier file."""

import os
import socket
import stat
from contextlib import closing

import pytest

from commhg_mj.base.files import held, whole_file


def write(out, text="new"):
    with whole_file(out) as part:
        part.write_text(text)


def test_a_file_is_replaced_at_once(tmp_path):
    out = tmp_path / "a.txt"
    out.write_text("old")
    with whole_file(out) as part:
        part.write_text("new")
        assert out.read_text() == "old" and part.suffix == ".txt"
    assert out.read_text() == "new" and list(tmp_path.iterdir()) == [out]


@pytest.mark.parametrize("name", ["clip-12:30.mp4", "ä ö\n.txt", "a" * 255, "%d.png", "-x", "\udcff.txt"])
def test_any_legal_name(tmp_path, name):
    write(tmp_path / name)
    assert (tmp_path / name).read_text() == "new" and len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("old", ["old", None], ids=["there", "dangling"])
def test_a_link_stays_and_leads_to_the_file(tmp_path, old):
    real, link, again = tmp_path / "folder" / "real.txt", tmp_path / "link.txt", tmp_path / "again.txt"
    real.parent.mkdir()
    if old:
        real.write_text(old)
    link.symlink_to("folder/real.txt")
    again.symlink_to(link)
    write(again)
    assert link.is_symlink() and again.is_symlink() and real.read_text() == "new"
    assert list(real.parent.iterdir()) == [real] and len(list(tmp_path.iterdir())) == 3


def test_what_is_no_file_is_refused_and_stays(tmp_path):
    pipe, link, loop, folder = (tmp_path / name for name in ("pipe", "link", "loop", "folder"))
    os.mkfifo(pipe)
    link.symlink_to(pipe)
    loop.symlink_to(loop)
    folder.mkdir()
    with closing(socket.socket(socket.AF_UNIX)) as listener:
        listener.bind(str(tmp_path / "socket"))
        before = {path: path.lstat().st_ino for path in tmp_path.iterdir()}
        for path in before:
            with pytest.raises(ValueError, match=f"cannot write {path}: it is ") as error:
                write(path)
            assert "\n" not in str(error.value)
        assert {path: path.lstat().st_ino for path in tmp_path.iterdir()} == before
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_after_an_error_the_old_file_is_as_it_was(tmp_path):
    out = tmp_path / "a.txt"
    out.write_text("old")
    with pytest.raises(ValueError, match=f"cannot write {out}: No space"), whole_file(out) as part:
        part.write_text("half")
        raise OSError(28, "No space left on device")
    assert out.read_text() == "old" and list(tmp_path.iterdir()) == [out]


def test_a_folder_is_held_once(tmp_path):
    with held(tmp_path):
        with pytest.raises(ValueError, match=f"^{tmp_path} is in use by another process$"), held(tmp_path):
            pass
    with held(tmp_path):
        assert len(list(tmp_path.iterdir())) == 1


def test_a_folder_that_cannot_be_held_is_named(tmp_path):
    (tmp_path / ".lock").mkdir()
    with pytest.raises(ValueError, match=f"^cannot write {tmp_path}: "), held(tmp_path):
        pass
