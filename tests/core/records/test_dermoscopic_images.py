from __future__ import annotations

import io
from collections.abc import Callable
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image, ImageCms

from core.capture.rgbd import RgbdCapture
from core.errors import InputError
from core.records import ClinicStore, Lesion, PatientDraft, User, Visit
from core.records.images import check_image, shown_image, thumbnail_png


def picture(
    kind: str = "JPEG", size: tuple[int, int] = (96, 64), mode: str = "RGB", **options: object
) -> bytes:
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 256, (size[1], size[0], 3), dtype=np.uint8)
    out = io.BytesIO()
    Image.fromarray(pixels).convert(mode).save(out, kind, **options)
    return out.getvalue()


@pytest.fixture
def lesion(store: ClinicStore, doctor: User, visit: Visit) -> Lesion:
    return store.lesions.create(visit.patient_id, visit.id, by=doctor.id)


@pytest.mark.parametrize(
    ("data", "media_type"),
    [
        (picture("JPEG"), "image/jpeg"),
        (picture("PNG"), "image/png"),
        (picture("PNG", mode="L"), "image/png"),
        (picture("TIFF", compression="tiff_lzw"), "image/tiff"),
        (picture("TIFF", mode="CMYK"), "image/tiff"),
    ],
)
def test_the_bytes_are_kept_untouched(
    store: ClinicStore, doctor: User, visit: Visit, lesion: Lesion, data: bytes, media_type: str
) -> None:
    image = store.dermoscopy.add(lesion.id, visit.id, data, doctor.id, "polarised")
    assert store.dermoscopy.data(image.id) == data
    assert (image.media_type, image.width, image.height, image.size_bytes) == (media_type, 96, 64, len(data))
    assert (image.added_by, image.note) == (doctor.id, "polarised")
    assert store.dermoscopy.for_lesion(lesion.id) == [image] == store.dermoscopy.for_visit(visit.id)
    small = Image.open(io.BytesIO(store.dermoscopy.thumbnail(image.id, 48)))
    assert small.size == (48, 32)
    assert small.mode == "RGB"


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"%PDF-1.7 not an image",
        picture("JPEG")[: len(picture("JPEG")) // 2],
        picture("PNG")[:-200],
        picture("TIFF")[:-500],
        picture("PNG", size=(8, 8)),
        picture("GIF", mode="P"),
        picture("PNG")[:40] + bytes(100),
    ],
    ids=["empty", "pdf", "cut jpeg", "cut png", "cut tiff", "tiny", "gif", "spoilt png"],
)
def test_what_is_not_a_whole_picture_is_refused(
    store: ClinicStore, doctor: User, visit: Visit, lesion: Lesion, data: bytes
) -> None:
    with pytest.raises(InputError) as caught:
        store.dermoscopy.add(lesion.id, visit.id, data, doctor.id)
    assert "JPEG, PNG or TIFF" in caught.value.advice
    assert store.dermoscopy.for_visit(visit.id) == []
    assert list(store._blobs.names()) == []


def test_a_decompression_bomb_is_refused_before_it_unfolds() -> None:
    header = picture("PNG", size=(16, 16))
    huge = (60_000).to_bytes(4, "big")
    bomb = header[:16] + huge + huge + header[24:]
    import zlib

    bomb = bomb[:29] + zlib.crc32(bomb[12:29]).to_bytes(4, "big") + bomb[33:]
    with pytest.raises(InputError, match="too large to be a photograph"):
        check_image(bomb)


@settings(max_examples=150, deadline=None)
@given(
    st.sampled_from([picture("JPEG", (40, 30)), picture("PNG", (40, 30)), picture("TIFF", (40, 30))]),
    st.lists(st.tuples(st.integers(0, 5000), st.integers(0, 255)), min_size=1, max_size=8),
)
def test_spoilt_pictures_are_accepted_or_refused_but_never_crash(
    data: bytes, changes: list[tuple[int, int]]
) -> None:
    spoilt = bytearray(data)
    for place, value in changes:
        spoilt[place % len(spoilt)] = value
    with suppress(InputError):
        check_image(bytes(spoilt))
    with suppress(InputError):
        thumbnail_png(bytes(spoilt), 32)


def test_orientation_and_colour_profile_are_obeyed() -> None:
    out = io.BytesIO()
    image = Image.new("RGB", (60, 30), "black")
    image.paste("white", (0, 0, 30, 30))
    exif = Image.Exif()
    exif[0x0112] = 6
    image.save(out, "JPEG", exif=exif, quality=95)
    facts = check_image(out.getvalue())
    assert (facts.width, facts.height) == (30, 60)
    shown = np.asarray(shown_image(out.getvalue())).astype(int)
    assert shown.shape == (60, 30, 3)
    assert shown[:25].mean() > 240 > 15 > shown[35:].mean()

    out = io.BytesIO()
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    Image.new("RGB", (32, 32), (200, 40, 40)).save(out, "PNG", icc_profile=profile)
    assert np.abs(np.asarray(shown_image(out.getvalue())).astype(int) - (200, 40, 40)).max() <= 1


def test_sixteen_bit_and_transparent_pictures_are_shown() -> None:
    out = io.BytesIO()
    Image.fromarray(np.linspace(0, 65535, 32 * 32).reshape(32, 32).astype(np.uint16)).save(out, "PNG")
    shown = np.asarray(shown_image(out.getvalue()))
    assert shown[0].mean() < 10
    assert shown[-1].mean() > 245
    out = io.BytesIO()
    Image.new("RGBA", (32, 32), (0, 0, 0, 0)).save(out, "PNG")
    assert np.asarray(shown_image(out.getvalue())).min() == 255


def test_images_belong_to_the_patient_s_own_lesions(
    store: ClinicStore, doctor: User, visit: Visit, lesion: Lesion, capture_of: Callable[..., RgbdCapture]
) -> None:
    other = store.patients.create(PatientDraft("B"), by=doctor.id)
    foreign = store.visits.create(other.id, doctor.id)
    with pytest.raises(InputError):
        store.dermoscopy.add(lesion.id, foreign.id, picture(), doctor.id)
    image = store.dermoscopy.add(lesion.id, visit.id, picture(), doctor.id)
    store.dermoscopy.remove(image.id, doctor.id)
    assert store.dermoscopy.for_lesion(lesion.id) == []
    image = store.dermoscopy.add(lesion.id, visit.id, picture(), doctor.id)
    store.visits.close(visit.id, doctor.id)
    with pytest.raises(InputError, match="closed visit"):
        store.dermoscopy.remove(image.id, doctor.id)
