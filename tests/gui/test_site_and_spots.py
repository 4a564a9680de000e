"""The follow-up's newer acts with the mouse: other places, spots of one visit, refining, checking a site."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from PySide6.QtTest import QTest

from app.widgets.photo_view import PhotoView
from app.workflows.evidence import SeenSpot
from app.workflows.table import State
from core.records import CandidatePlace, ObservationDraft
from tests.gui.conftest import World, seen
from tests.gui.test_visit_windows import LEFT, Hands, Open, capture_both, open_page

__all__ = ["open_page"]


def _site_texts(hands: Hands) -> tuple[str, str]:
    return hands.find("site_verdict").text(), hands.find("site_figures").text()  # type: ignore[attr-defined]


def test_regions_other_places_spots_refining_and_the_check_of_a_site(open_page: Open, world: World) -> None:
    hands = open_page(follow_up=True)
    capture_both(hands, world, "A2")
    hands.click("capture_primary")
    session, screen = hands.page.session, hands.page.lesions.screen
    hands.click("pane_photo")
    ids = [int(i) for i in screen.list.ids()]
    here = session.snapshot.views["front"]

    # every proposal has its region on the photo, as long as its size in the list says
    o = session.snapshot.in_force(ids[0])
    assert o is not None
    marker = next(m for m in screen.photo.markers() if m.id == str(ids[0]))
    outline = np.array(marker.outline)
    assert len(outline) > 20
    axes, camera = session.evidence.axes_m(o), session.analysed(here).capture.rig.picture_camera
    assert axes is not None
    assert o.point_m is not None
    length = np.linalg.norm(outline - outline.mean(axis=0), axis=1).max()
    assert length <= 1.1 * axes[0] * camera.fx / o.point_m[2]

    # the other places of an ambiguous lesion are shown; a click takes one, and can be undone
    free = list(seen(world.captures["A2"]).values())
    other = CandidatePlace(free[-2], None, 0.3)
    session.store.observations.put(
        ObservationDraft(
            ids[0], session.visit_id, here, "ambiguous", o.pixel, o.point_m, 0.03, 0.4, candidates=(other,)
        ),
        by=session.user_id,
    )
    session.reload()
    hands.page.lesions.select(ids[0])
    assert "Several places" in screen.list.item(0, 2).text()
    names = [m.id for m in screen.photo.markers() if m.id.startswith("candidate:")]
    assert len(names) == 1
    hands.click_photo("lesion_photo", free[-2])
    corrected = session.snapshot.in_force(ids[0])
    assert corrected is not None
    assert corrected.decision == "corrected"
    assert corrected.pixel == free[-2]
    hands.page.lesions.select(ids[0])
    hands.click("undo_lesion")
    assert session.snapshot.in_force(ids[0]).decision == "proposed"  # type: ignore[union-attr]

    # spots of one visit: listed neutrally, marked by one click
    assert not screen.spots_button.isVisible()
    reference = session.snapshot.plan().searches[0].reference_capture_id
    spot = SeenSpot(here, free[-1], 0.8)
    session.evidence.keep_spots((spot,), (SeenSpot(reference, free[-3], 0.6),))
    session.reload()
    hands.click("show_spots")
    assert hands.find("spots_panel").isVisible()
    assert not screen.details_area.isVisible()
    assert [m.label for m in screen.photo.markers() if m.id == spot.key] == ["?"]
    hands.click(f"mark_{spot.key}")
    assert len(session.snapshot.shown_lesions()) == len(ids) + 1
    assert hands.page.minimumSizeHint().height() <= 900
    hands.click("show_spots")
    assert screen.details_area.isVisible()

    # decided lesions hold the search for the others, in a task
    assert not screen.refine_button.isVisible()
    hands.page.lesions.select(ids[0])
    hands.click("confirm_lesion")
    assert screen.refine_button.isVisible()
    QTest.mouseClick(screen.refine_button, LEFT)
    assert hands.page.overlay.task is not None
    hands.page.overlay.task.cancel()
    hands.wait()
    assert "Nothing was changed" in hands.banner
    hands.click("refine_lesions")
    assert "looked for again" in hands.banner
    assert session.snapshot.in_force(ids[0]).decision == "confirmed"  # type: ignore[union-attr]
    assert hands.state is State.CHECK

    # the check of a site, in the review
    hands.click("lesions_primary")
    review = hands.page.review.screen
    hands.click("check_site")
    assert "Which lesion?" in hands.banner
    review.selected.emit(str(ids[0]))
    hands.click("check_site")
    assert hands.find("site_reason").text() == "Click the site on the photo."  # type: ignore[attr-defined]
    place = session.snapshot.in_force(ids[0])
    assert place is not None
    assert place.pixel is not None
    hands.click_photo("review_photo", place.pixel)
    hands.wait()
    verdict, figures = _site_texts(hands)
    assert verdict == "Inside", "the doctor confirmed this very place"
    assert figures.count("mm") >= 3
    hands.click_photo("review_photo", (place.pixel[0], place.pixel[1] + 30))
    hands.wait()
    assert _site_texts(hands)[0] == "Outside"
    hands.click_photo("review_photo", (10.0, 10.0))
    hands.wait()
    assert _site_texts(hands)[0] == "Cannot tell"
    assert not hands.find("site_figures").isVisible() or "centre" not in _site_texts(hands)[1]
    photo = hands.find("review_photo")
    assert isinstance(photo, PhotoView)
    assert "site" in {m.id for m in photo.markers()}
    assert hands.page.minimumSizeHint().height() <= 900
    review.selected.emit(str(ids[1]))
    assert not hands.find("site_panel").isVisible(), "another lesion, another question"


def test_a_marker_keeps_its_region_when_it_is_dragged() -> None:
    from app.widgets.markers import Marker
    from app.widgets.photo_items import MarkerItem

    item = MarkerItem(Marker("1", "1", 50.0, 50.0, outline=((40.0, 45.0), (60.0, 45.0), (60.0, 55.0))))
    before = item.boundingRect()
    item.drag_to(90.0, 50.0)
    assert item.boundingRect().contains(before.adjusted(5, 5, -5, -5))
    item.set_marker(replace(item.marker, outline=()))
    item.end_drag()
    assert item.boundingRect().width() < before.width()
