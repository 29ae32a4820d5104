"""Cosine and sine of angles in degrees: the same bits with the compiled kernel and without."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hipuq.compiled.binding import kernel

Array = NDArray[np.float64]

SHIFTER = 1.5 * 2.0**52
FACTOR = np.pi / 180
HIGH = float.fromhex("0x1.1df46ap-6")
LOW = float.fromhex("0x1.294e9c8ae0ec6p-33")
"""pi / 180, its leading 25 bits and the rest to twice the precision."""

SINE = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)
COSINE = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)
"""Coefficients of fdlibm's k_sin.c and k_cos.c (Sun Microsystems, 1993)."""

LARGEST_ANGLE = 1e9
"""Angles above are taken modulo 360 first [deg]."""


def cosine_and_sine(angle: Array) -> tuple[Array, Array]:
    """Return the cosine and the sine of angles, to 0.8 units in the last place.

    Multiples of 90 degrees are taken off exactly, so those of them give exactly 0, 1 or -1.

    Parameters
    ----------
    angle : array
        [deg], finite.

    Returns
    -------
    cosine, sine : array of the same shape
    """
    angle = np.require(angle, np.float64, ["C", "A"])
    if np.abs(angle).max(initial=0.0) > LARGEST_ANGLE:
        angle = np.fmod(angle, 360.0)
    compiled = kernel()
    if compiled is None:
        return _polynomials(angle)
    cosine, sine = np.empty_like(angle), np.empty_like(angle)
    compiled.degrees(angle.size, angle.ctypes.data, cosine.ctypes.data, sine.ctypes.data)
    return cosine, sine


def _polynomials(angle: Array) -> tuple[Array, Array]:
    """Do what `degrees.h` does, operation by operation."""
    shifted = angle * (1.0 / 90.0) + SHIFTER
    quarter = shifted.view(np.int64) & 3
    rest = angle - 90.0 * (shifted - SHIFTER)
    high = (rest.view(np.int64) & ~np.int64(0x7FFFFFF)).view(np.float64)
    product, correction = high * HIGH, high * LOW + (rest - high) * FACTOR
    x = product + correction
    error = (product - x) + correction
    z = x * x
    half = 0.5 * z
    s, c = (_horner(z, coefficients) for coefficients in (SINE, COSINE))
    start = 1.0 - half
    sine = x + (x * z * s + error * (1.0 - half))
    cosine = start + (((1.0 - start) - half) + (z * z * c - x * error))
    swap = (quarter & 1) != 0
    sine, cosine = np.where(swap, cosine, sine), np.where(swap, sine, cosine)
    sine = np.where((quarter & 2) != 0, -sine, sine) + 0.0
    cosine = np.where(((quarter + 1) & 2) != 0, -cosine, cosine) + 0.0
    return cosine, sine


def _horner(z: Array, coefficients: tuple[float, ...]) -> Array:
    value = np.full_like(z, coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        value = coefficient + z * value
    return value
