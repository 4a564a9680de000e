from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.devices.openni_driver.feed import FeedFolder, make_feed, shared_redist


@pytest.fixture(scope="session")
def feed_redist() -> Path:
    """The real runtime with the feeding driver beside its own."""
    built = shared_redist()
    if isinstance(built, str):
        pytest.skip(built)
    return built


@pytest.fixture
def feeds(
    feed_redist: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[..., FeedFolder]]:
    """Make a camera of files: ``feeds("name", serial=..., color=False)``; it is also listed as connected."""
    monkeypatch.setenv("OPENNI2_REDIST64", str(feed_redist))
    made: list[FeedFolder] = []

    def make(name: str = "camera", **facts: Any) -> FeedFolder:
        made.append(make_feed(tmp_path / name, **facts))
        monkeypatch.setenv("OPENNI_FEED_FOLDERS", ":".join(str(f.folder) for f in made))
        return made[-1]

    yield make
    for feed in made:  # a driver that waits for its command to be taken back must not wait for ever
        for command in ("hang", "stall"):
            feed.undo(command)
