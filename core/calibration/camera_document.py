"""Intrinsics read back from JSON, checked."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from core.capture.camera import PinholeCamera


class CameraDocument(BaseModel):
    """What `PinholeCamera.document` writes."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)
    width: int = Field(gt=0, le=20000)
    height: int = Field(gt=0, le=20000)
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: list[float] = []

    def camera(self) -> PinholeCamera:
        """The camera; raises `InputError` if the numbers make none."""
        values = self.model_dump()
        return PinholeCamera(**{**values, "distortion": tuple(values["distortion"])})
