"""From depth frames to the patient's skin: fusion, segmentation, the surface, and clicks on it."""

from core.surface.body_surface import BodySurface
from core.surface.denoise import denoise_depth
from core.surface.fusion import FusedDepth, fuse_depth
from core.surface.picking import SkinPick, pick_skin, pick_skin_depth
from core.surface.points import SurfacePoint
from core.surface.raycast import RayHits
from core.surface.scan import BodyScan, scan_body
from core.surface.segmentation import BodyMask, segment_body
from core.surface.warm_up import warm_up

__all__ = [
    "BodyMask",
    "BodyScan",
    "BodySurface",
    "FusedDepth",
    "RayHits",
    "SkinPick",
    "SurfacePoint",
    "denoise_depth",
    "fuse_depth",
    "pick_skin",
    "pick_skin_depth",
    "scan_body",
    "segment_body",
    "warm_up",
]
