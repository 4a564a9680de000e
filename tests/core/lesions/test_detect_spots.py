import numpy as np
import pytest

from core.lesions import SkinSpots, detect_spots
from core.surface import BodyScan, pick_skin, scan_body
from tests.core.lesions.conftest import BROWN, CENTER, DARK_SKIN, HALF, Disc, color_camera, meet, trunk

SPOTS = (
    Disc(560.3, 400.6, 3.5),
    Disc(660.7, 380.2, 2.2),
    Disc(640.2, 520.8, 5.0),
    Disc(700.5, 600.1, 3.0),
    Disc(590.0, 640.5, 1.8),
    Disc(720.4, 470.7, 4.0, (120, 80, 60)),
)


def resized(discs: tuple[Disc, ...], factor: float) -> list[Disc]:
    return [Disc((d.u + 0.5) * factor - 0.5, (d.v + 0.5) * factor - 0.5, d.radius * factor) for d in discs]


def nearest(spots: SkinSpots, disc: Disc) -> tuple[int, float]:
    away = np.linalg.norm(spots.pixels - (disc.u, disc.v), axis=1)
    return int(away.argmin()), float(away.min())


def sure(spots: SkinSpots) -> SkinSpots:
    return spots.take(spots.confidence > 0.5)


@pytest.fixture(scope="module")
def scan() -> BodyScan:
    return scan_body(trunk(SPOTS))


@pytest.fixture(scope="module")
def spots(scan: BodyScan) -> SkinSpots:
    return detect_spots(scan)


def test_clean_discs_are_found_to_a_tenth_of_a_pixel_and_nothing_else_is_sure(spots):
    for disc in SPOTS:
        assert nearest(sure(spots), disc)[1] < 0.1
    assert len(sure(spots)) == len(SPOTS)


def test_size_and_contrast_are_those_of_the_disc(spots):
    for disc in SPOTS:
        row, _ = nearest(spots, disc)
        assert spots.radius_px[row] == pytest.approx(disc.radius, rel=0.15)
    big, _ = nearest(spots, SPOTS[2])
    brown, skin = (0.25 * c[0] + 0.5 * c[1] + 0.25 * c[2] for c in (BROWN, (205, 150, 125)))
    assert spots.contrast[big] == pytest.approx(np.log(skin / brown), rel=0.1)
    # Shaded, the ratio of the colours stays.
    ratio = spots.skin_color[big] / spots.color[big]
    assert ratio == pytest.approx(np.array([205, 150, 125]) / BROWN, rel=0.1)


def test_every_spot_lies_on_the_skin(scan, spots):
    camera = color_camera()
    rays = camera.rays([(d.u, d.v) for d in SPOTS])
    for disc, ray in zip(SPOTS, rays, strict=True):
        row, _ = nearest(spots, disc)
        truth = meet(ray) * ray
        assert np.linalg.norm(spots.points_m[row] - truth) < 0.003
        normal = (truth - CENTER) / HALF**2
        assert spots.normals[row] @ normal / np.linalg.norm(normal) > 0.98
        assert spots.radius_m[row] == pytest.approx(disc.radius * truth[2] / camera.fx, rel=0.15)
    on_surface = np.einsum(
        "nk,nkx->nx", spots.barycentric, scan.surface.vertices[scan.surface.triangles[spots.triangles]]
    )
    assert np.linalg.norm(on_surface - spots.points_m, axis=1).max() < 0.013


def test_a_spot_is_where_a_click_on_it_would_be(scan, spots):
    for row in range(len(spots)):
        pick = pick_skin(scan, spots.pixels[row])
        if pick.point is not None:
            assert spots.points_m[row] == pytest.approx(pick.point.position_m, abs=1e-6)


@pytest.mark.parametrize("width", [640, 3840])
def test_small_and_large_pictures_show_the_same_spots(width):
    discs = resized(SPOTS[:4], width / 1280)
    found = sure(detect_spots(scan_body(trunk(discs, width=width))))
    for disc in discs:
        assert nearest(found, disc)[1] < 0.15 * max(1.0, width / 2560)
    assert len(found) == len(discs)


def test_moles_on_dark_skin_are_found():
    discs = [Disc(d.u, d.v, d.radius, (48, 31, 24)) for d in SPOTS]
    found = sure(detect_spots(scan_body(trunk(discs, skin=DARK_SKIN))))
    assert all(nearest(found, disc)[1] < 0.2 for disc in discs)
    assert len(found) == len(discs)


def test_light_and_white_balance_change_neither_places_nor_contrast(spots):
    other = detect_spots(scan_body(trunk(SPOTS, light=(0.75, 0.68, 0.6), seed=5)))
    for disc in SPOTS:
        one, two = nearest(spots, disc)[0], nearest(other, disc)[0]
        assert np.linalg.norm(spots.pixels[one] - other.pixels[two]) < 0.15
        assert other.contrast[two] == pytest.approx(spots.contrast[one], abs=0.08)


def test_hairs_are_no_moles_and_hide_none():
    rng = np.random.default_rng(3)
    middle = rng.uniform((540, 380), (740, 620), (40, 2))
    angle, half = rng.uniform(0.8, 1.6, 40), rng.uniform(8, 16, 40)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1) * half[:, None]
    lines = [(*a, *b) for a, b in zip(middle - along, middle + along, strict=True)]
    hairy = sure(detect_spots(scan_body(trunk(SPOTS[:3], lines=lines))))
    true = [nearest(hairy, disc) for disc in SPOTS[:3]]
    assert sum(away < 0.6 for _, away in true) >= 2
    assert len(hairy) - sum(away < 0.6 for _, away in true) <= 1


def test_dots_printed_on_cloth_are_no_moles():
    dots = [Disc(u, v, 3.0, (20, 20, 25)) for u in range(580, 720, 20) for v in range(520, 620, 20)]
    dressed = trunk([*dots, Disc(640.0, 420.0, 3.5)], cloth=(500, 640, (90, 110, 170)))
    found = sure(detect_spots(scan_body(dressed)))
    assert nearest(found, Disc(640.0, 420.0, 3.5))[1] < 0.1
    assert len(found) == 1


def test_a_mole_where_the_depth_of_the_rim_is_lost_lies_on_the_tangent_plane():
    row = 480.0
    columns = np.arange(1280.0)
    rays = color_camera().rays(np.stack([columns, np.full(1280, row)], axis=1))
    inside = columns[np.isfinite(meet(rays))]
    disc = Disc(float(inside.max()) - 9.0, row, 2.5)
    scan = scan_body(trunk([disc], lost_rim_px=3))
    _, directions = scan.capture.rig.picture_rays([(disc.u, disc.v)])
    assert not scan.surface.raycast(np.zeros(3), directions).hit[0]
    found = detect_spots(scan)
    row_found, away = nearest(found, disc)
    assert away < 1.0
    ray = directions[0]
    assert np.linalg.norm(found.points_m[row_found] - meet(ray[None])[0] * ray) < 0.02


def test_bare_skin_without_moles_has_none():
    assert len(sure(detect_spots(scan_body(trunk())))) == 0


def test_without_a_colour_picture_there_are_no_spots():
    assert len(detect_spots(scan_body(trunk(with_color=False)))) == 0


def test_rows_can_be_picked_and_come_best_first(spots):
    assert (np.diff(spots.confidence) <= 0).all()
    two = spots.take(np.array([2, 0]))
    assert len(two) == 2
    assert two.pixels[1] == pytest.approx(spots.pixels[0])
    assert len(SkinSpots.none()) == 0
