"""Compare the boundaries of all published contact patterns with the exact discriminant.

    python tests/validate_onsets.py [first] [step]

Half an hour on one core: about 8 s for each of the 130 patterns and 2 presets. Prints every pattern in
which something differs, and the widest window that the search leaves out. A window that is not there
with cosines of 100 digits is one of the doubles, not of the ring, and is counted apart. `first` and
`step` take every step-th pattern only.
"""

import sys
import time

import flint
import numpy as np
from discriminant import meetings
from exact_ring import exact_values, ring_matrices

import hipuq
from hipuq.cea.onset import boundaries
from hipuq.models import CEAModel

UPPER = 0.1
PRESETS = ("oberst2016", "oberst2016-calibrated")


def compare(found: np.ndarray, exact: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the largest relative error of the boundaries, and the windows that were left, (k, 2)."""
    if not found.size or not exact.size:
        return (0.0 if not found.size else np.inf), exact.reshape(-1, 2)
    nearest = np.abs(found[:, None] - exact).argmin(axis=1)
    error = np.abs(found / exact[nearest] - 1).max()
    left = np.delete(exact, nearest)
    if len(left) % 2 or len(np.unique(nearest)) < len(found):
        return np.inf, np.empty((0, 2))
    return error, left.reshape(-1, 2)


def persists(window: np.ndarray, model: CEAModel, contact: np.ndarray) -> bool:
    """Say whether the ring of exact angles has a complex pair in a window, looked at in 9 places."""
    flint.ctx.prec = 400
    constant, slope, _ = ring_matrices(exact_values(model, contact=contact.astype(int).tolist()))
    found = False
    for friction in np.linspace(*window, 11)[1:-1]:
        polynomial = (constant + slope * flint.arb(friction)).charpoly()
        # The roots that are zero by construction are zero here but for the width of the balls.
        rigid = max(0, len(contact) - 1 - int(contact.sum()))
        roots = flint.acb_poly(polynomial.coeffs()[rigid:]).roots(maxprec=4000)
        found |= any(not root.imag.contains(0) for root in roots)
    flint.ctx.prec = 53
    return found


def main(first: int, step: int) -> int:
    """Compare, print, and return the exit status."""
    patterns = hipuq.ContactPatterns(in_contact=(6, 7, 8, 9)).samples()
    rows = np.arange(first, patterns.sizes["sample"], step)
    wrong = 0
    for preset in PRESETS:
        model = hipuq.models.ring(preset)
        pencils = model.pencils(patterns.isel(sample=rows))
        found = boundaries(pencils, 0.0, UPPER)
        constant, slope = pencils.reduced_parts()
        worst, widest, rounding, start = 0.0, 0.0, 0, time.time()
        for row, own, zero, one in zip(rows, found, constant, slope, strict=True):
            exact = meetings(zero, one, 0.0, UPPER)
            error, windows = compare(np.array([b.friction for b in own]), np.array(exact))
            worst, missed = max(worst, error), 0
            for window in windows:
                widest = max(widest, np.ptp(window))
                if np.ptp(window) > 1e-7:
                    missed += persists(window, model, patterns.contact.values[row])
                    rounding += 1
            if error > 1e-12 or missed or not all(b.certified for b in own):
                wrong += 1
                print(f"{preset}, pattern {row}: error {error:.1e}, {missed} windows missed", own, exact)
        count = sum(map(len, found))
        print(
            f"{preset}: {len(rows)} patterns, {count} boundaries, largest relative error {worst:.1e}, "
            f"widest window left out {widest:.1e}, wider than 1e-7 {rounding}, {time.time() - start:.0f} s",
            flush=True,
        )
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main(*(int(x) for x in sys.argv[1:])) if len(sys.argv) > 2 else main(0, 1))
