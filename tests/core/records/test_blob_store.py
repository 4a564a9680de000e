from __future__ import annotations

import errno
import hashlib
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from core.capture.rgbd import RgbdCapture
from core.errors import GeodermError, InputError
from core.records import ClinicStore, User, Visit
from core.records.blobs import BlobStore, write_atomically
from core.records.failures import DamagedError, StorageError


@pytest.fixture
def blobs(tmp_path: Path) -> BlobStore:
    return BlobStore(tmp_path / "blobs")


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.lists(st.binary(max_size=200), max_size=5))
def test_what_is_put_is_got_under_its_hash(blobs: BlobStore, items: list[bytes]) -> None:
    names = blobs.put_many(items)
    assert names == [hashlib.sha256(data).hexdigest() for data in items]
    assert [blobs.get(name) for name in names] == items
    assert set(names) <= set(blobs.names())


def test_damage_is_found_and_mended_by_storing_again(blobs: BlobStore) -> None:
    name = blobs.put(b"a mole")
    assert blobs.check(name) is None
    blobs.path(name).write_bytes(b"a mold")
    assert blobs.check(name) == "damaged"
    with pytest.raises(DamagedError, match="damaged"):
        blobs.get(name)
    blobs.put(b"a mole")
    assert blobs.get(name) == b"a mole"
    blobs.path(name).unlink()
    assert blobs.check(name) == "missing"
    with pytest.raises(DamagedError, match="missing"):
        blobs.get(name)


def test_names_never_leave_the_folder(blobs: BlobStore) -> None:
    with pytest.raises(ValueError, match="64 hexadecimal"):
        blobs.get("../../etc/passwd")


def test_a_cipher_sees_every_byte_that_reaches_the_disk(tmp_path: Path) -> None:
    class Mirror:
        def seal(self, plain: bytes) -> bytes:
            return plain[::-1]

        def open(self, sealed: bytes) -> bytes:
            return sealed[::-1]

    blobs = BlobStore(tmp_path, Mirror())
    name = blobs.put(b"secret")
    assert blobs.path(name).read_bytes() == b"terces"
    assert blobs.get(name) == b"secret"
    assert blobs.check(name) is None, "damage is found without opening anything"


@pytest.mark.parametrize(
    ("number", "message"),
    [
        (errno.ENOSPC, "is full"),
        (errno.EROFS, "may not write"),
        (errno.EIO, "reports an error"),
        (errno.ESTALE, "cannot reach"),
    ],
)
def test_disk_errors_leave_nothing_half_written(
    blobs: BlobStore, monkeypatch: pytest.MonkeyPatch, number: int, message: str
) -> None:
    real, calls = os.fsync, []

    def failing(handle: int) -> None:
        calls.append(handle)
        if len(calls) > 1:
            raise OSError(number, "from the disk")
        real(handle)

    monkeypatch.setattr(os, "fsync", failing)
    with pytest.raises(StorageError, match=message) as caught:
        blobs.put_many([b"first", b"second", b"third"])
    monkeypatch.undo()
    assert caught.value.advice
    left = [path for path in blobs._folder.rglob("*") if path.is_file()]
    assert [path.read_bytes() for path in left] == [b"first"]


def test_programming_errors_are_not_dressed_up(blobs: BlobStore, monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(handle: int) -> None:
        raise OSError(errno.EBADF, "closed too early")

    monkeypatch.setattr(os, "fsync", failing)
    with pytest.raises(OSError, match="closed too early"):
        blobs.put(b"x")


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "report.pdf"
    write_atomically(path, b"old")

    def failing(handle: int) -> None:
        raise OSError(errno.ENOSPC, "full")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", failing)
        with pytest.raises(OSError, match="full"):
            write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]
    write_atomically(path, b"new")
    assert path.read_bytes() == b"new"


class TestVerify:
    def test_every_flipped_file_is_named_and_the_rest_stays_usable(
        self, store: ClinicStore, visit: Visit, capture_of: Callable[..., RgbdCapture]
    ) -> None:
        spoilt = store.captures.add(visit.id, capture_of(1), "psi")
        sound = store.captures.add(visit.id, capture_of(2), "working")
        assert store.verify() == []
        names = store.captures._files(spoilt.id, "depth")
        path = store._blobs.path(names[1])
        data = bytearray(path.read_bytes())
        data[len(data) // 2] ^= 1
        path.write_bytes(data)
        store._blobs.path(store.captures._files(spoilt.id, "color")[0]).unlink()
        assert sorted(store.verify()) == [
            f"Depth frame 2 of capture {spoilt.id} (patient record 1, visit 1) is damaged.",
            f"The colour picture of capture {spoilt.id} (patient record 1, visit 1) is missing.",
        ]
        with pytest.raises(DamagedError):
            store.captures.load(spoilt.id)
        store.captures.load(sound.id)

    def test_a_full_disk_leaves_no_row(
        self,
        store: ClinicStore,
        doctor: User,
        visit: Visit,
        capture: RgbdCapture,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        def failing(handle: int) -> None:
            raise OSError(errno.ENOSPC, "full")

        with monkeypatch.context() as patch:
            patch.setattr(os, "fsync", failing)
            with pytest.raises(StorageError, match="full"):
                store.captures.add(visit.id, capture, "psi")
        assert store.captures.list(visit.id) == []
        assert store.verify() == []
        store.captures.add(visit.id, capture, "psi")


@pytest.mark.skipif(os.geteuid() == 0 if hasattr(os, "geteuid") else True, reason="root may write anywhere")
def test_a_read_only_folder_is_a_clear_message(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(StorageError, match="may not write"):
        ClinicStore.open(tmp_path / "clinic")


def test_a_folder_that_is_a_file_is_a_clear_message(tmp_path: Path) -> None:
    (tmp_path / "clinic").write_text("not a folder")
    with pytest.raises((StorageError, InputError)) as caught:
        ClinicStore.open(tmp_path / "clinic")
    assert isinstance(caught.value, GeodermError)
