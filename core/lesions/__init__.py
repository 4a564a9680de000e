"""Mole-like spots on the skin: finding all of them, which one a click means, and how alike two look."""

from core.lesions.appearance import appearance_distance
from core.lesions.clicks import spot_at
from core.lesions.known_spots import spots_of
from core.lesions.spots import SkinSpots, detect_spots

__all__ = ["SkinSpots", "appearance_distance", "detect_spots", "spot_at", "spots_of"]
