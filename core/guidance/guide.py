"""All live readings of one camera, moment after moment."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.anchors.live_pose import LivePose
from core.capture.rgbd import CameraRig
from core.guidance.coverage import coverage_reading
from core.guidance.framing import Reach, distance_reading, frame_reading, nobody
from core.guidance.light import backlight_reading, light_reading
from core.guidance.moment import Moment
from core.guidance.person import Person, PersonFinder
from core.guidance.readings import Guidance, Reading, unknown
from core.guidance.sharpness import blur_reading
from core.guidance.stance import stance_reading
from core.guidance.stillness import StillnessMeter


class LiveGuide:
    """Judges successive frames of one camera. Not for several threads at a time.

    Parameters
    ----------
    reach : Reach
        Distances that suit the sensor.
    """

    def __init__(self, reach: Reach | None = None) -> None:
        self.reach = reach or Reach()
        self._finder = PersonFinder()
        self._meter = StillnessMeter()
        self.person: Person | None = None
        self.moment: Moment | None = None

    def update(
        self,
        time_s: float,
        depth: NDArray[np.uint16],
        depth_unit_m: float,
        rgb: NDArray[np.uint8] | None,
        rig: CameraRig,
        pose: LivePose | None = None,
        *,
        psi: bool = False,
        whole_body: bool = True,
    ) -> Guidance:
        """Judge the frame that was taken at a time.

        Parameters
        ----------
        time_s : float
            Of the depth frame, on any steady clock.
        depth : ndarray (h, w) uint16
        depth_unit_m : float
        rgb : ndarray (h', w', 3) uint8 or None
        rig : CameraRig
        pose : LivePose, optional
            The newest live skeleton, in pixels of the full picture.
        psi : bool
            Whether the psi stance is wanted.
        whole_body : bool
            Whether the feet must be seen.
        """
        moment = Moment.of(time_s, depth, depth_unit_m, rgb, rig, pose)
        person = self._finder.find(moment)
        self.moment, self.person = moment, person
        found: list[Reading] = []
        if person is None:
            found += [
                nobody(moment),
                *(unknown(n) for n in ("frame", "light", "backlight", "blur", "coverage")),
            ]
        else:
            found += [
                distance_reading(person, moment, self.reach),
                frame_reading(person, moment, whole_body=whole_body),
                *_of_picture(moment, person),
                coverage_reading(person),
            ]
        if psi:
            found.insert(2, stance_reading(moment, person, whole_body=whole_body))
        found.append(self._meter.update(moment, person))
        return Guidance(time_s, {reading.name: reading for reading in found}, person is not None)


def _of_picture(moment: Moment, person: Person) -> list[Reading]:
    shown = moment.picture_mask(person.mask)
    if moment.rgb is None or moment.grey is None or shown is None:
        return [unknown("light"), unknown("backlight"), unknown("blur")]
    return [
        light_reading(moment.rgb, shown),
        backlight_reading(moment.rgb, shown),
        blur_reading(moment.grey, shown),
    ]
