"""Measured training frames in a folder: measuring a thousand of them takes minutes, reading them a second."""

from __future__ import annotations

import inspect
import io
import json
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any, Final

import numpy as np

from core.errors import WorkError
from core.evaluation.hand.frames import FrameSet
from core.evaluation.records import code_fingerprint
from core.hand.documents import write_file
from core.hand.model import LabelledFrame
from core.hand.trying import MeasuredHand

_SURFACE: Final = ("surface", "surface_kernels", "segmentation", "segmentation_kernels", "skin_patch")
_ANCHORS: Final = ("marker", "marker_anchors", "marker_edges", "marker_kernels", "palm_anchors")
_OTHERS: Final = ("landmark_lifting", "fields", "learning", "stills")


class MeasuredFiles:
    """Keeps what was measured of a set of frames.

    Parameters
    ----------
    folder : Path
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def read(self, frames: FrameSet, kind: str) -> tuple[list[MeasuredHand], list[tuple[str, str]]] | None:
        """Hands and what was left out, if this very program has measured these very frames."""
        path = self._path(frames, kind)
        if not path.exists():
            return None
        try:
            with np.load(path) as kept:
                about = json.loads(kept["about"].tobytes())
                hands = [_hand(kept, k, name) for k, name in enumerate(about["configurations"])]
        except (OSError, ValueError, KeyError) as error:
            raise WorkError(f"{path}: cannot be read ({error}).", "Remove it; it is made again.") from error
        return hands, [(str(name), str(why)) for name, why in about["left_out"]]

    def write(
        self, frames: FrameSet, kind: str, hands: list[MeasuredHand], left_out: list[tuple[str, str]]
    ) -> None:
        """Keep them."""
        about = {"configurations": [hand.frame.configuration for hand in hands], "left_out": left_out}
        arrays: dict[str, Any] = {"about": np.frombuffer(json.dumps(about).encode(), np.uint8)}
        for k, hand in enumerate(hands):
            arrays[f"anchor_{k}"], arrays[f"pair_{k}"] = hand.frame.anchor_m, hand.frame.pair_m
            arrays[f"vertices_{k}"], arrays[f"triangles_{k}"] = hand.vertices_m, hand.triangles
            arrays[f"values_{k}"] = hand.values_m
        content = io.BytesIO()
        np.savez(content, **arrays)
        path = self._path(frames, kind)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_file(path, content.getvalue())

    def _path(self, frames: FrameSet, kind: str) -> Path:
        key = sha256(repr(frames).encode()).hexdigest()[:12]
        return self._folder / f"measured-{measuring_code()}" / f"{kind}-{frames.body}-{key}.npz"


def _hand(kept: Any, k: int, name: str) -> MeasuredHand:
    frame = LabelledFrame(name, kept[f"anchor_{k}"], kept[f"pair_{k}"])
    return MeasuredHand(frame, kept[f"vertices_{k}"], kept[f"triangles_{k}"], kept[f"values_{k}"])


@lru_cache(maxsize=1)
def measuring_code() -> str:
    """Fingerprint of what measures a frame (of the kernels, the one that it uses: `fields.end_distance`)."""
    import core.hand
    from core.hand.fit_kernels import farthest_beyond

    root = Path(core.hand.__file__).parent
    files = code_fingerprint([root / f"{name}.py" for name in (*_SURFACE, *_ANCHORS, *_OTHERS)])
    kernel = inspect.getsource(farthest_beyond.py_func)
    return f"{files}-{sha256(kernel.encode()).hexdigest()[:6]}"
