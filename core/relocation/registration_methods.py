"""The dense registration, alone and fused with trilateration: methods of the registry."""

from __future__ import annotations

from collections.abc import Sequence

from core.relocation.geodesic_check import geodesic_fixes
from core.relocation.judgement import judge
from core.relocation.lone_spots import new_spots, vanished_spots
from core.relocation.pair import PickedLesion, VisitPair
from core.relocation.recognition import recognise
from core.relocation.registration.dense import one_linear_algebra_thread
from core.relocation.registry import MethodContext, MethodOutcome
from core.relocation.transfer import Transfer, transfer_skin
from core.relocation.trilateration import Fix
from core.relocation.trilateration_method import TrilaterationMethod
from core.relocation.types import Estimate

NO_TRUNK = "The trunk was not found in both captures; the surfaces cannot be laid onto each other."
GEODESICS_ALONE = f"{NO_TRUNK} Answers come from distances along the skin alone."


class RegistrationMethod:
    """Dense registration, pinned by the constellation of moles where looks may be used."""

    name = "registration"

    def estimate(
        self, pair: VisitPair, lesions: Sequence[PickedLesion], context: MethodContext
    ) -> MethodOutcome:
        """One estimate per lesion."""
        with one_linear_algebra_thread():
            transfer = transfer_skin(pair, lesions, context)
            if transfer is None:
                return MethodOutcome(tuple(Estimate(None, reason=NO_TRUNK) for _ in lesions))
            return _outcome(pair, transfer, None, context)


class FusedMethod:
    """The shipped estimator: registration, geodesic trilateration and constellation in one answer.

    Trilateration starts nothing here that the skeleton does not start better, but it stands on other
    evidence: it checks every answer, narrows those that the registration knows badly, and carries all of
    them where there is no trunk to start a registration from.
    """

    name = "fused"

    def estimate(
        self, pair: VisitPair, lesions: Sequence[PickedLesion], context: MethodContext
    ) -> MethodOutcome:
        """One estimate per lesion."""
        with one_linear_algebra_thread():
            transfer = transfer_skin(pair, lesions, context)
            if transfer is None:
                outcome = TrilaterationMethod().estimate(pair, lesions, context)
                return MethodOutcome(outcome.estimates, (*outcome.warnings, GEODESICS_ALONE))
            context.progress(0.9, "Checking with distances along the skin")
            return _outcome(pair, transfer, geodesic_fixes(pair, lesions, context), context)


def _outcome(
    pair: VisitPair, transfer: Transfer, fixes: tuple[Fix | None, ...] | None, context: MethodContext
) -> MethodOutcome:
    with context.clock.phase("judgement"):
        recognition = recognise(pair, transfer)
        if recognition.obstacle:
            refused = Estimate(None, reason=recognition.obstacle)
            return MethodOutcome((refused,) * transfer.moles.lesions)
        return MethodOutcome(
            judge(pair, transfer, recognition, fixes),
            warnings=recognition.warnings,
            sight_judged=True,
            new_spots=new_spots(pair, transfer),
            vanished_spots=vanished_spots(pair, transfer),
        )
