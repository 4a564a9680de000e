"""Pictures of an explanation, over the photograph or the depth relief, each with its legend."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from core.anchors import AnalysedCapture, shade_depth
from core.relocation.explain import LesionExplanation

FloatArray = NDArray[np.float64]
Rgb = NDArray[np.uint8]
Color = tuple[int, int, int]

HEIGHT = 1200
LEGEND_WIDTH = 400
MARGIN_M = 0.10
PAPER: Color = (250, 250, 252)
INK: Color = (28, 34, 44)
QUIET: Color = (105, 114, 128)
CANDIDATE: Color = (255, 196, 0)
CLUSTER: Color = (214, 39, 40)
ANSWER: Color = (0, 170, 90)


@dataclass(frozen=True, eq=False)
class Backdrop:
    """The part of a capture's picture that shows the body, and how skin points fall on it.

    Attributes
    ----------
    image : ndarray (h, w, 3) uint8
        RGB, subdued so that drawings stand out.
    scale : float
        Backdrop pixels per picture pixel.
    offset : ndarray (2,)
        Picture pixel of the backdrop's first pixel.
    """

    image: Rgb
    scale: float
    offset: FloatArray
    analysed: AnalysedCapture

    def place(self, points_m: FloatArray) -> FloatArray:
        """Backdrop pixels (n, 2) of points (n, 3)."""
        pixels = self.analysed.capture.rig.project_to_picture(points_m)
        return np.asarray((pixels - self.offset) * self.scale)

    @cached_property
    def triangle_map(self) -> NDArray[np.int32]:
        """Triangle of the skin behind every pixel (h, w), farther ones under nearer ones; -1 without skin."""
        surface = self.analysed.scan.surface
        order = np.argsort(-surface.vertices[surface.triangles, 2].max(axis=1))
        corners = np.rint(self.place(surface.vertices) * 16).astype(np.int32)[surface.triangles[order]]
        out = np.full(self.image.shape[:2], -1, np.int32)
        for number, polygon in zip(order.tolist(), corners, strict=True):
            cv2.fillConvexPoly(out, polygon, number, cv2.LINE_8, 4)
        return out


def backdrop(analysed: AnalysedCapture, height: int = HEIGHT) -> Backdrop:
    """Crop a capture's picture to its body and bring it to a height in pixels."""
    capture, surface = analysed.capture, analysed.scan.surface
    pixels = capture.rig.project_to_picture(surface.vertices)
    camera = capture.rig.picture_camera
    margin = MARGIN_M * camera.fx / float(np.median(surface.vertices[:, 2]))
    low = np.maximum(np.floor(pixels.min(axis=0) - margin), 0).astype(int)
    high = np.minimum(np.ceil(pixels.max(axis=0) + margin), [camera.width, camera.height]).astype(int)
    if capture.color is not None:
        picture = capture.color
    else:
        picture = shade_depth(analysed.scan.fused.depth_m, analysed.scan.mask.mask, capture.rig.depth)
    crop = picture[low[1] : high[1], low[0] : high[0]]
    scale = height / crop.shape[0]
    shrink = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    image = cv2.resize(crop, None, fx=scale, fy=scale, interpolation=shrink)
    grey = image.mean(axis=2, keepdims=True)
    subdued = 0.55 * (0.35 * image + 0.65 * grey) + 0.45 * 255
    return Backdrop(subdued.astype(np.uint8), scale, low.astype(float), analysed)


def anchor_colors(count: int) -> list[Color]:
    """Colours that can be told apart, alternating in brightness around the wheel."""
    hsv = np.zeros((1, max(count, 1), 3), np.uint8)
    hsv[0, :, 0] = (np.arange(max(count, 1)) * 180 / max(count, 1)).astype(np.uint8)
    hsv[0, :, 1] = 225
    hsv[0, :, 2] = np.where(np.arange(max(count, 1)) % 2, 165, 235)
    rgb = cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB)[0]
    return [(int(c[0]), int(c[1]), int(c[2])) for c in rgb[:count]]


def draw_explanation(
    explanation: LesionExplanation, first: AnalysedCapture, followup: AnalysedCapture
) -> dict[str, Rgb]:
    """RGB pictures by name: paths of both visits, bands, vote map, biggest cluster."""
    before, after = backdrop(first), backdrop(followup)
    colors = dict(zip(explanation.anchor_names, anchor_colors(len(explanation.anchor_names)), strict=True))
    lesion = explanation.lesion_id
    return {
        "1-paths-first": _with_legend(
            _draw_paths(before, explanation.first_paths, colors, explanation.lesion_m),
            f"Lesion {lesion}: earlier visit",
            "Shortest ways along the skin to the anchors" + _left_out(explanation.first_untraced),
            _distance_rows(explanation, colors),
        ),
        "2-bands": _with_legend(
            _mark(_draw_bands(after, explanation, colors), after, explanation.answer_m),
            f"Lesion {lesion}: bands",
            f"Skin as far from each anchor as the lesion was, ± {1000 * explanation.delta_m:.0f} mm",
            _distance_rows(explanation, colors),
        ),
        "3-votes": _with_legend(
            _mark(_draw_votes(after, explanation), after, explanation.answer_m),
            f"Lesion {lesion}: votes",
            "Number of bands that hold each point of the skin",
            _vote_rows(explanation),
        ),
        "4-cluster": _with_legend(
            _mark(_draw_cluster(after, explanation), after, explanation.answer_m),
            f"Lesion {lesion}: biggest cluster",
            f"Most voted points: {len(explanation.candidates)} with {explanation.votes.max()} votes",
            (
                (CANDIDATE, "other most voted points"),
                (CLUSTER, f"biggest cluster ({len(explanation.biggest_cluster)} points)"),
                (ANSWER, "answer"),
            ),
        ),
        "5-paths-followup": _with_legend(
            _draw_paths(after, explanation.paths, colors, explanation.answer_m),
            f"Lesion {lesion}: follow-up",
            "The same ways from the place that was found" + _left_out(explanation.untraced),
            _distance_rows(explanation, colors, explanation.paths),
        ),
    }


def _paint(canvas: Rgb, at: Backdrop, chosen: NDArray[np.bool_], color: FloatArray, opacity: float) -> None:
    """Fill the triangles whose corners are all chosen with their corners' mean colour (n, 3)."""
    triangles = at.analysed.scan.surface.triangles
    shown = np.append(chosen[triangles].all(axis=1), False)
    mask = shown[at.triangle_map]
    fill = color[triangles[at.triangle_map[mask]]].mean(axis=1)
    canvas[mask] = (canvas[mask] * (1 - opacity) + fill * opacity).astype(np.uint8)


def _draw_bands(at: Backdrop, explanation: LesionExplanation, colors: Mapping[str, Color]) -> Rgb:
    canvas = at.image.copy()
    palette = np.array([colors[name] for name in explanation.anchor_names], dtype=float)
    for i in range(len(explanation.anchor_names)):
        member = explanation.bands[i]
        _paint(canvas, at, member, np.broadcast_to(palette[i], (len(member), 3)), 0.42)
    return canvas


def _draw_votes(at: Backdrop, explanation: LesionExplanation) -> Rgb:
    canvas = at.image.copy()
    votes = explanation.votes
    color = _ramp(votes / max(int(votes.max()), 1))
    _paint(canvas, at, np.ones(len(votes), bool), color, 0.9)
    return canvas


def _ramp(values: FloatArray) -> FloatArray:
    grey = np.rint(np.clip(values, 0, 1) * 255).astype(np.uint8).reshape(-1, 1)
    bgr = cv2.applyColorMap(grey, cv2.COLORMAP_VIRIDIS).reshape(-1, 3)
    return np.asarray(bgr[:, ::-1], dtype=float)


def _draw_cluster(at: Backdrop, explanation: LesionExplanation) -> Rgb:
    canvas = at.image.copy()
    vertices = at.analysed.scan.surface.vertices
    spots = at.place(vertices)
    radius = max(
        2,
        round(
            at.scale * at.analysed.capture.rig.picture_camera.fx * 0.0025 / float(np.median(vertices[:, 2]))
        ),
    )
    for index, color in ((explanation.candidates, CANDIDATE), (explanation.biggest_cluster, CLUSTER)):
        for u, v in np.rint(spots[index]).astype(int):
            cv2.circle(canvas, (int(u), int(v)), radius, color, -1, cv2.LINE_AA)
    return canvas


def _draw_paths(
    at: Backdrop, paths: Mapping[str, FloatArray], colors: Mapping[str, Color], origin_m: FloatArray
) -> Rgb:
    canvas = at.image.copy()
    for name, path in paths.items():
        line = np.rint(at.place(path) * 16).astype(np.int32).reshape(-1, 1, 2)
        cv2.polylines(canvas, [line], False, (255, 255, 255), 6, cv2.LINE_AA, 4)
        cv2.polylines(canvas, [line], False, colors[name], 3, cv2.LINE_AA, 4)
        end = (int(line[-1, 0, 0]), int(line[-1, 0, 1]))
        cv2.circle(canvas, end, 9 * 16, (255, 255, 255), -1, cv2.LINE_AA, 4)
        cv2.circle(canvas, end, 7 * 16, colors[name], -1, cv2.LINE_AA, 4)
    return _mark(canvas, at, origin_m)


def _mark(canvas: Rgb, at: Backdrop, place_m: FloatArray) -> Rgb:
    u, v = np.rint(at.place(place_m.reshape(1, 3))[0] * 16).astype(int)
    for radius, color, width in ((17, (255, 255, 255), 6), (17, ANSWER, 3)):
        cv2.circle(canvas, (int(u), int(v)), radius * 16, color, width, cv2.LINE_AA, 4)
    cv2.circle(canvas, (int(u), int(v)), 3 * 16, ANSWER, -1, cv2.LINE_AA, 4)
    return canvas


def _distance_rows(
    explanation: LesionExplanation,
    colors: Mapping[str, Color],
    paths: Mapping[str, FloatArray] | None = None,
) -> tuple[tuple[Color, str], ...]:
    rows = []
    for name, distance in zip(explanation.anchor_names, explanation.distances_m, strict=True):
        if paths is not None and name in paths:
            distance = float(np.linalg.norm(np.diff(paths[name], axis=0), axis=1).sum())
        text = f"{100 * distance:.1f} cm" if np.isfinite(distance) else "not connected"
        if paths is not None and name not in paths:
            text = "no path" if name in explanation.untraced else "not connected"
        rows.append((colors[name], f"{name.replace('_', ' ')}   {text}"))
    return tuple(rows)


def _left_out(untraced: Sequence[str]) -> str:
    """What a legend says about ways that could not be drawn."""
    names = ", ".join(name.replace("_", " ") for name in untraced)
    return f". No path could be followed to: {names}" if names else ""


def _vote_rows(explanation: LesionExplanation) -> tuple[tuple[Color, str], ...]:
    most = max(int(explanation.votes.max()), 1)
    ramp = _ramp(np.arange(most, -1, -1) / most)
    rows = [
        ((int(c[0]), int(c[1]), int(c[2])), f"{most - i} of {len(explanation.anchor_names)} anchors")
        for i, c in enumerate(ramp)
    ]
    return (*rows, (ANSWER, "answer"))


def _with_legend(picture: Rgb, title: str, subtitle: str, rows: Sequence[tuple[Color, str]]) -> Rgb:
    """The picture with a panel at its right: title, subtitle, colour swatches."""
    height, width = picture.shape[:2]
    sheet = Image.new("RGB", (width + LEGEND_WIDTH, height), PAPER)
    sheet.paste(Image.fromarray(picture), (0, 0))
    draw = ImageDraw.Draw(sheet)
    large, normal = ImageFont.load_default(30), ImageFont.load_default(22)
    x, y = width + 28, 30
    for line in _wrapped(draw, title, large, LEGEND_WIDTH - 56):
        draw.text((x, y), line, INK, font=large)
        y += 38
    for line in _wrapped(draw, subtitle, normal, LEGEND_WIDTH - 56):
        draw.text((x, y), line, QUIET, font=normal)
        y += 28
    y += 20
    step = min(44, max(26, (height - y - 20) // max(len(rows), 1)))
    for color, text in rows:
        draw.rounded_rectangle((x, y + 2, x + 28, y + 26), 5, fill=color)
        draw.text((x + 42, y + 1), text, INK, font=normal)
        y += step
    return np.asarray(sheet)


def _wrapped(
    draw: ImageDraw.ImageDraw, text: str, font: ImageFont.ImageFont | ImageFont.FreeTypeFont, width: int
) -> list[str]:
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and draw.textlength(longer, font=font) > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines
