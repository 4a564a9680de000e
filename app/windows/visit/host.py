"""What the steps of a visit ask of the page that holds them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

from app.widgets.status import MessageBanner
from app.workflows.session import VisitSession
from core.progress import Progress

if TYPE_CHECKING:
    from app.context import AppContext


class VisitHost(Protocol):
    """The visit page, as its steps see it."""

    context: AppContext
    session: VisitSession
    banner: MessageBanner
    frames: int

    def run(
        self,
        title: str,
        work: Callable[[Progress], Any],
        done: Callable[[Any], None],
        *,
        stopped: Callable[[], None] | None = None,
    ) -> None:
        """Do long work behind the progress overlay; ``stopped`` is called after a failure or a cancel."""

    def attempt(self, act: Callable[[], Any]) -> Any:
        """Do quick work; an error of the world goes to the banner and None is returned."""

    def show_dermoscopy(self, lesion_id: int | None, image_id: int) -> None:
        """Show the dermoscopic images of a lesion, two visits side by side where there are two."""

    def explain(self, lesion_id: int) -> None:
        """Show how the proposed place of a lesion came about."""
