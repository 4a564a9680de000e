"""What the application knows: surfaces, geodesics, relocation, records, exchange. No Qt, no device."""

import os
import sys

if sys.platform == "linux":
    # Kernels run from the window's worker and from other threads at once: numba's fallback layer ends the
    # process then, and its first choice (TBB) warns about the copy that other libraries bring along.
    os.environ.setdefault("NUMBA_THREADING_LAYER", "omp")
