"""Files are written whole or not at all, and what is no file is left what it is."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from core.errors import WorkError
from core.hand.documents import write_document, write_text


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    target, link = tmp_path / "there" / "t.json", tmp_path / "link.json"
    target.parent.mkdir()
    target.write_text("old", encoding="utf-8")
    link.symlink_to(target)
    write_text(link, "new")
    assert link.is_symlink()
    assert target.read_text(encoding="utf-8") == "new"
    assert [p.name for p in target.parent.iterdir()] == ["t.json"]


def test_a_device_stays_a_device(tmp_path: Path) -> None:
    full = tmp_path / "full"
    full.symlink_to("/dev/full")
    with pytest.raises(WorkError, match="No space left"):
        write_document(full, {"a": 1})
    assert full.is_char_device()
    assert [p.name for p in tmp_path.iterdir()] == ["full"]


def test_a_pipe_is_written_into_and_not_waited_for(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(WorkError, match="cannot be written"):  # nobody reads
        write_text(pipe, "lost")
    text = "x" * 300_000  # more than a pipe holds
    with ThreadPoolExecutor(1) as readers:
        # open for reading before anybody writes; the reading itself runs beside the writing
        reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
        os.set_blocking(reader, True)
        holder = os.open(pipe, os.O_WRONLY)  # the reader finds no early end
        read = readers.submit(_read_whole, reader)
        write_text(pipe, text)
        os.close(holder)
        assert read.result(20) == text


def _read_whole(descriptor: int) -> str:
    with os.fdopen(descriptor, encoding="utf-8") as file:
        return file.read()


def test_links_in_a_circle_are_no_file(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    with pytest.raises(WorkError):
        write_text(tmp_path / "a", "x")
