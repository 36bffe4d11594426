"""Files that are whole or not there, whoever writes them, and hashes of what they hold."""

import errno
import os
import threading
import time

import pytest

from eqs.content import content_hash, content_hashes
from eqs.files import ABANDONED_S, FileLock, complete_file, is_full, one_at_a_time


def test_a_file_has_its_name_only_when_it_is_whole(tmp_path) -> None:
    path = tmp_path / "a" / "note"
    with complete_file(path) as partial:
        partial.write_text("half")
        assert not path.exists()
        partial.write_text("whole")
    assert path.read_text() == "whole"
    assert [file.name for file in path.parent.iterdir()] == ["note"]


def test_a_failed_writer_leaves_the_old_file_and_nothing_else(tmp_path) -> None:
    path = tmp_path / "note"
    path.write_text("old")

    def fail() -> None:
        with complete_file(path) as partial:
            partial.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert path.read_text() == "old"
    assert [file.name for file in tmp_path.iterdir()] == ["note"]


def test_two_writers_of_one_file_do_not_meet(tmp_path) -> None:
    path = tmp_path / "note"
    with complete_file(path) as first:
        first.write_text("first")
        with complete_file(path) as second:
            second.write_text("second")
        assert path.read_text() == "second"
    assert path.read_text() == "first"


def test_what_a_killed_writer_left_long_ago_is_removed(tmp_path) -> None:
    old, young, other = (tmp_path / name for name in ("n.1.partial", "n.2.partial", "m.1.partial"))
    for path in (old, young, other):
        path.write_text("half")
    for path in (old, other):
        os.utime(path, (time.time() - 2 * ABANDONED_S,) * 2)
    with complete_file(tmp_path / "n") as partial:
        partial.write_text("whole")
    assert {file.name for file in tmp_path.iterdir()} == {"n", "n.2.partial", "m.1.partial"}


def test_one_works_while_the_others_wait(tmp_path) -> None:
    path, worked = tmp_path / "data", []

    def work() -> None:
        with one_at_a_time(path, "working"):
            if not path.exists():
                worked.append(threading.get_ident())
                time.sleep(0.2)
                path.write_text("done")

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(worked) == 1


def test_equal_bytes_have_equal_hashes_whatever_the_names(tmp_path) -> None:
    for name, text in (("a", "same"), ("b", "same"), ("c", "else")):
        (tmp_path / name).write_text(text)
    one, same, other = content_hashes(tmp_path / name for name in "abc")
    assert one == same != other


def test_a_remembered_hash_follows_a_change_that_hides(tmp_path) -> None:
    path = tmp_path / "frame"
    path.write_text("before")
    long_ago = time.time() - 100
    os.utime(path, (long_ago, long_ago))
    time.sleep(0.01)
    before = content_hash(path)
    path.write_text("after!")  # as long as before
    os.utime(path, (long_ago, long_ago))
    assert content_hash(path) != before


def test_hashes_are_found_without_a_place_to_remember_them(tmp_path, monkeypatch) -> None:
    path = tmp_path / "frame"
    path.write_text("bytes")
    expected = content_hash(path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(path))  # a file, where no folder can be
    assert content_hash(path) == expected


def test_a_settled_file_is_read_once(tmp_path, monkeypatch) -> None:
    path = tmp_path / "frame"
    path.write_text("bytes")
    monkeypatch.setattr("eqs.content.SETTLED_NS", -1)
    expected = content_hash(path)
    monkeypatch.setattr("eqs.content._digest", lambda _: "read again")
    assert content_hash(path) == expected


def test_who_works_is_told_whether_alone(tmp_path, monkeypatch, caplog) -> None:
    with one_at_a_time(tmp_path / "data", "working") as alone:
        assert alone

    def no_locks(*_, **__):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(FileLock, "acquire", no_locks)
    with one_at_a_time(tmp_path / "data", "working") as alone:
        assert not alone
    assert "start one command at a time" in caplog.text


def test_a_lock_that_fails_otherwise_is_no_silence(tmp_path, monkeypatch) -> None:
    def broken(*_, **__):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(FileLock, "acquire", broken)
    with pytest.raises(OSError, match="Input/output"), one_at_a_time(tmp_path / "data", "working"):
        pass


def test_only_want_of_room_is_a_full_disk() -> None:
    assert is_full(OSError(errno.EDQUOT, "Disk quota exceeded"))
    assert is_full(RuntimeError("unexpected pos 640 vs 534"))
    assert not is_full(OSError("file write failed: errno = 5, Input/output error"))
    assert not is_full(ValueError("Expected a file, got: File too large to be one"))
