/* One Newton step for the eigenvalues of a Hessenberg matrix, with Hyman's method for the characteristic
 * polynomial and its derivative: it takes away most of what rounding did in the sweeps.
 *
 * J. H. Wilkinson, The Algebraic Eigenvalue Problem (1965), chapter 7, sections 9 to 12: Hyman's method is
 * backward stable, entry by entry.
 */
#ifndef HIPUQ_POLISH_H
#define HIPUQ_POLISH_H

#include "lanes.h"

typedef struct {
    Vec re, im;
} Complex;

INLINE Complex quotient(Complex a, Complex b)
{
    const Vec inverse = 1.0 / plus(b.re * b.re, b.im, b.im);
    return (Complex){plus(a.re * b.re, a.im, b.im) * inverse, minus(a.im * b.re, a.re, b.im) * inverse};
}

/* Two at a time, so that one sum need not wait for the other. */
enum { AT_A_TIME = 2 };

typedef struct {
    Vec *re, *im; /* values, one vector of n for each eigenvalue at a time */
} Solutions;

/* Characteristic polynomial p over its derivative at each w. `inverse` holds -1 over the subdiagonal; `x`
 * takes the solution of (H - w) x = p e_1 with a one at its end, `dx` its derivative. With `real` all w are
 * on the real line; there is no difference in the bits of those that are. */
INLINE void newton(int n, int ld, const Vec *restrict h, const Vec *restrict inverse, const Complex *w, int real,
                   Solutions x, Solutions dx, Complex *step)
{
    Complex p[AT_A_TIME], d[AT_A_TIME];
    for (int g = 0; g < AT_A_TIME; g++) {
        x.re[g * n + n - 1] = all(1);
        x.im[g * n + n - 1] = dx.re[g * n + n - 1] = dx.im[g * n + n - 1] = all(0);
    }
    for (int i = n - 1; i >= 0; i--) {
        const Vec *row = h + i * ld;
        for (int g = 0; g < AT_A_TIME; g++) {
            const int at = g * n + i;
            const Vec off = row[i] - w[g].re;
            p[g].re = off * x.re[at];
            d[g].re = off * dx.re[at] - x.re[at];
            if (!real) {
                p[g].re = plus(p[g].re, w[g].im, x.im[at]);
                p[g].im = minus(off * x.im[at], w[g].im, x.re[at]);
                d[g].re = plus(d[g].re, w[g].im, dx.im[at]);
                d[g].im = minus(off * dx.im[at], w[g].im, dx.re[at]) - x.im[at];
            }
        }
        for (int j = i + 1; j < n; j++)
            for (int g = 0; g < AT_A_TIME; g++) {
                p[g].re = plus(p[g].re, row[j], x.re[g * n + j]);
                d[g].re = plus(d[g].re, row[j], dx.re[g * n + j]);
                if (!real) {
                    p[g].im = plus(p[g].im, row[j], x.im[g * n + j]);
                    d[g].im = plus(d[g].im, row[j], dx.im[g * n + j]);
                }
            }
        for (int g = 0; i > 0 && g < AT_A_TIME; g++) {
            const int next = g * n + i - 1;
            x.re[next] = p[g].re * inverse[i], dx.re[next] = d[g].re * inverse[i];
            if (!real)
                x.im[next] = p[g].im * inverse[i], dx.im[next] = d[g].im * inverse[i];
        }
    }
    for (int g = 0; g < AT_A_TIME; g++) {
        const Mask on_line = w[g].im == 0.0;
        const Complex off_line = real ? p[g] : quotient(p[g], d[g]);
        step[g].re = pick(on_line, p[g].re / d[g].re, off_line.re);
        step[g].im = real ? all(0) : pick(on_line, all(0), off_line.im);
    }
}

/* Move root k by its step, if that is small beside the distance of the nearest neighbour. */
INLINE Complex moved(int n, int k, Complex step, const Vec *restrict re, const Vec *restrict im)
{
    const Complex w = {re[k], im[k]};
    Vec nearest = all(INFINITY);
    for (int j = 0; j < n; j++) {
        if (j == k)
            continue;
        const Vec x = w.re - re[j], y = w.im - im[j], square = plus(x * x, y, y);
        nearest = smaller(nearest, square);
    }
    const Mask take = 256.0 * plus(step.re * step.re, step.im, step.im) < nearest;
    return (Complex){pick(take, w.re - step.re, w.re), pick(take & (w.im != 0.0), w.im - step.im, w.im)};
}

/* Better eigenvalues of the Hessenberg matrix h; of a pair the upper one first. `work` holds 11 n vectors. */
static void polish(int n, int ld, const Vec *restrict h, Vec *restrict re, Vec *restrict im,
                   Vec *restrict work)
{
    Vec *restrict new_re = work, *restrict new_im = work + n, *restrict inverse = work + 2 * n;
    const Solutions x = {work + 3 * n, work + 5 * n}, dx = {work + 7 * n, work + 9 * n};
    for (int j = 1; j < n; j++)
        inverse[j] = -1.0 / h[j * ld + j - 1];
    for (int first = 0; first < n; first += AT_A_TIME) {
        Complex w[AT_A_TIME], step[AT_A_TIME];
        Mask off_line = whole(0);
        for (int g = 0; g < AT_A_TIME; g++) {
            const int k = first + g < n ? first + g : n - 1;
            w[g] = (Complex){re[k], im[k]};
            off_line |= w[g].im != 0.0;
        }
        if (any(off_line))
            newton(n, ld, h, inverse, w, 0, x, dx, step);
        else
            newton(n, ld, h, inverse, w, 1, x, dx, step);
        for (int k = first; k < n && k < first + AT_A_TIME; k++) {
            const Complex now = moved(n, k, step[k - first], re, im);
            const Mask lower = im[k] < 0.0; /* the conjugate of the one before */
            new_re[k] = k > 0 ? pick(lower, new_re[k - 1], now.re) : now.re;
            new_im[k] = k > 0 ? pick(lower, -new_im[k - 1], now.im) : now.im;
        }
    }
    for (int k = 0; k < n; k++) {
        re[k] = new_re[k];
        im[k] = new_im[k];
    }
}

#endif
