"""Pictures of the hand experiments, after the thesis's figures 13 to 18."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from core.evaluation.hand.experiments import FinderMaker
from core.evaluation.hand.frames import FrameSet, HandSets, TrueFrame
from core.evaluation.hand.run import Outcome
from core.evaluation.hand.scores import OUTLIER_M, FrameScore
from core.evaluation.hand.summaries import by_body
from core.evaluation.hand_tree_picture import write_tree_picture
from core.evaluation.thesis.canvas import new_figure, quiet, save, styled
from core.hand.documents import write_file
from core.hand.names import BONES, FINGER_OF

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

FINGER_COLORS = ("#ff5a5f", "#ffb400", "#3ddc84", "#2fa8ff", "#c77dff")

_CROP_PX = 30
_COLUMNS = 4
_LINE, _LINE_OTHER, _BAD = "#1f7a8c", "#b9a36b", "#c0392b"


def draw_pictures(outcome: Outcome, sets: HandSets, marker: FinderMaker, folder: Path) -> list[Path]:
    """Draw what was measured; what was not run is left out.

    Raises
    ------
    WorkError
        If a picture cannot be written.
    """
    out: list[Path] = []

    def drawn(name: str, draw: Callable[[], Figure | None]) -> None:
        with styled():
            figure = draw()
            if figure is not None:
                photo = name.endswith(".jpg")
                out.append((save_photos if photo else save)(figure, folder / name))

    scores = outcome.scores
    for key in ("three", "five"):
        one = outcome.classified.get(key)
        if one is not None and one.model.tree is not None:
            path = folder / f"figure-14-tree-{key}.png"
            write_tree_picture(path, one.model.tree)
            out.append(path)
    drawn("figure-13-configurations.jpg", lambda: configurations_figure(scores.get("stills six", []), sets))
    if "marker" in outcome.models:
        from core.evaluation.hand.candidates_picture import candidates_figure

        drawn("figure-15-candidates.png", lambda: candidates_figure(sets, outcome.models["marker"], marker()))
    drawn(
        "figure-16-large-displacements.png",
        lambda: errors_figure(scores.get("large joint", []), scores.get("large sequential", [])),
    )
    passing = [s for s in scores.get("occlusion 12", []) if s.remark]
    drawn("figure-17-occlusion.jpg", lambda: sequence_figure(passing, sets.occluded))
    drawn("figure-18-bottle.jpg", lambda: sequence_figure(scores.get("bottle", []), sets.bottle))
    drawn("marker-lost.png", lambda: errors_figure(scores.get("lost", []), []))
    return out


def save_photos(figure: Figure, path: Path) -> Path:
    """Write a JPEG, whole or not at all: photographs in 256 colours lose the colours of small things."""
    content = io.BytesIO()
    figure.savefig(content, format="jpg", dpi=110, facecolor="white", pil_kwargs={"quality": 88})
    write_file(path, content.getvalue())
    return path


def configurations_figure(scores: Sequence[FrameScore], sets: HandSets) -> Figure | None:
    """Points and bones over the picture, one hand after the other for every configuration (figure 13).

    Not the best ones: of configuration c the first frames of hands c, c + 6 and so on.
    """
    bodies = list(by_body(scores))
    chosen: list[FrameScore] = []
    for row in range(2):
        for c, name in enumerate(sets.six):
            body = bodies[(c + row * len(sets.six)) % len(bodies)] if bodies else ""
            chosen += [s for s in scores if s.body == body and s.configuration == name][:1]
    return pictures_figure(chosen, sets.test, columns=len(sets.six))


def sequence_figure(scores: Sequence[FrameScore], sets: Sequence[FrameSet], count: int = 8) -> Figure | None:
    """Frames of the first sequence, evenly over time (figures 17 and 18)."""
    some = list(by_body(scores).values())[:1]
    if not some:
        return None
    places = np.linspace(0, len(some[0]) - 1, min(count, len(some[0])))
    return pictures_figure([some[0][round(p)] for p in places], sets, columns=_COLUMNS)


def pictures_figure(scores: Sequence[FrameScore], sets: Sequence[FrameSet], columns: int) -> Figure | None:
    """Told points and bones in the pictures; true places of visible points as small crosses."""
    if not scores:
        return None
    bodies = {score.body for score in scores}
    frames = frames_named({score.name for score in scores}, [one for one in sets if one.body in bodies])
    rows = -(-len(scores) // columns)
    figure = new_figure(2.3 * columns, 2.6 * rows)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax in axes:
        quiet(ax)
    for ax, score in zip(axes, scores, strict=False):
        draw_answer(ax, frames[score.name], score)
    return figure


def frames_named(names: set[str], sets: Sequence[FrameSet]) -> dict[str, TrueFrame]:
    """Frames by name."""
    return {frame.name: frame for some in sets for frame in some if frame.name in names}


def draw_answer(ax: Axes, frame: TrueFrame, score: FrameScore) -> None:
    """One picture with its answer, cut out around the hand."""
    picture = frame.capture.color
    if picture is None:
        return
    true = frame.capture.rig.project_to_picture(frame.points_m)
    ax.imshow(picture, interpolation="bilinear")
    for a, b in BONES:
        if score.told[a] and score.told[b]:
            ax.plot(*score.pixels[[a, b]].T, color=FINGER_COLORS[FINGER_OF[a]], lw=1.6)
    for p in np.flatnonzero(score.told):
        ax.plot(*score.pixels[p], "o", ms=4.5, color=FINGER_COLORS[FINGER_OF[p]], mec="white", mew=0.5)
    ax.plot(*true[score.visible].T, "x", ms=3.0, color="black", mew=0.8)
    middle = 0.5 * (true.min(axis=0) + true.max(axis=0))
    half = 0.5 * float((true.max(axis=0) - true.min(axis=0)).max()) + _CROP_PX
    ax.set_xlim(middle[0] - half, middle[0] + half)
    ax.set_ylim(middle[1] + half, middle[1] - half)
    said = score.told_configuration or ("unknown" if score.likeliest is not None else "no answer")
    shown = score.configuration or "between two"
    error = f"{1e3 * np.median(score.visible_error_m):.1f} mm" if len(score.visible_error_m) else "no point"
    ax.set_title(f"{shown}: said {said}\n{int(score.told.sum())} points, {error}", fontsize=7)


def errors_figure(scores: Sequence[FrameScore], others: Sequence[FrameScore]) -> Figure | None:
    """Median joint-joint error of every frame, a row for every hand; outliers marked (figure 16)."""
    rows = by_body(scores)
    if not rows:
        return None
    beside = by_body(others)
    figure = new_figure(9.0, 1.5 * len(rows) + 0.5)
    axes = figure.subplots(len(rows), 1, sharex=True, squeeze=False).ravel()
    for ax, (body, some) in zip(axes, rows.items(), strict=True):
        error = 1e3 * np.array([s.joint_error_m for s in some])
        frames = np.arange(1, len(some) + 1)
        if body in beside:
            other = 1e3 * np.array([s.joint_error_m for s in beside[body]])
            ax.plot(frames, other, color=_LINE_OTHER, lw=0.9, label="eq. 7, point after point")
        ax.plot(frames, error, color=_LINE, lw=1.2, label="all points together")
        followed = np.array([s.anchored == "followed" for s in some])
        ax.plot(frames[followed], error[followed], ".", color="#e08e0b", ms=4, label="marker not seen")
        outlier = np.array([s.outlier for s in some])
        ax.plot(frames[outlier], error[outlier], "o", color=_BAD, mfc="none", ms=7, label="outlier")
        silent = ~np.isfinite(error)
        ax.plot(frames[silent], np.zeros(silent.sum()), "|", color=_BAD, ms=7, label="no answer")
        ax.axhline(1e3 * OUTLIER_M, color=_BAD, lw=0.7, ls="--")
        ax.set_ylim(0, max(18.0, 1.1 * float(np.nanmax(np.append(error[np.isfinite(error)], 0.0)))))
        ax.set_title(body, loc="left", fontsize=8)
        ax.set_ylabel("mm")
    axes[-1].set_xlabel("frame")
    axes[0].legend(ncols=5, fontsize=7, loc="upper right")
    return figure
