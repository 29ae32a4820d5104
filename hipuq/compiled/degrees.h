/* Cosine and sine of angles in degrees.
 *
 * The nearest multiple of 90 is taken off exactly; what is left, at most 45 degrees, goes to radians in
 * two parts. Polynomials: coefficients of fdlibm's k_sin.c and k_cos.c (Sun Microsystems, 1993), good to
 * 2^-58 up to pi / 4. Angles above 1e9 degrees are not for this.
 */
#ifndef HIPUQ_DEGREES_H
#define HIPUQ_DEGREES_H

#include "lanes.h"

INLINE void cosine_and_sine(Vec angle, Vec *cosine, Vec *sine)
{
    const double shifter = 6755399441055744.0; /* 1.5 * 2^52: adding it rounds to whole numbers */
    const Vec shifted = angle * (1.0 / 90.0) + shifter;
    const Mask quarter = (Mask)shifted & 3;
    const Vec rest = angle - 90.0 * (shifted - shifter);

    /* pi / 180 and the remainder each in two parts of 26 bits, so that the leading product is exact. */
    const double factor = 0x1.1df46a2529d39p-6, high = 0x1.1df46ap-6, low = 0x1.294e9c8ae0ec6p-33;
    const Vec rest_high = (Vec)((Mask)rest & ~(Mask)whole(0x7ffffff)), rest_low = rest - rest_high;
    const Vec product = rest_high * high, correction = rest_high * low + rest_low * factor;
    const Vec x = product + correction, error = (product - x) + correction;

    const Vec z = x * x, half = 0.5 * z;
    const Vec s = -1.66666666666666324348e-01
        + z * (8.33333333332248946124e-03
        + z * (-1.98412698298579493134e-04
        + z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10))));
    const Vec c = 4.16666666666666019037e-02
        + z * (-1.38888888888741095749e-03
        + z * (2.48015872894767294178e-05
        + z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))));
    const Vec sin_x = x + (x * z * s + error * (1.0 - half));
    const Vec start = 1.0 - half, cos_x = start + (((1.0 - start) - half) + (z * z * c - x * error));

    const Mask swap = (quarter & 1) != 0;
    const Vec sin_turned = pick(swap, cos_x, sin_x), cos_turned = pick(swap, sin_x, cos_x);
    *sine = pick((quarter & 2) != 0, -sin_turned, sin_turned) + 0.0;
    *cosine = pick(((quarter + 1) & 2) != 0, -cos_turned, cos_turned) + 0.0;
}

#endif
