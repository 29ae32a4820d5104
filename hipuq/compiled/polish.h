/* One step of Ehrlich and Aberth for the eigenvalues of a Hessenberg matrix, with Hyman's method for
 * the characteristic polynomial: it takes away most of what rounding did in the sweeps.
 *
 * J. H. Wilkinson, The Algebraic Eigenvalue Problem (1965), chapter 7, sections 9 to 12: Hyman's method is
 * backward stable, entry by entry; D. A. Bini, L. Gemignani, F. Tisseur, SIAM J. Matrix Anal. Appl. 27 (2005)
 * 153: the step with the other eigenvalues kept off.
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

/* Characteristic polynomial p over its derivative at w. `inverse` holds -1 over the subdiagonal; `work`, 4 n
 * vectors, the solution of (H - w) x = p e_1 with a one at its end, and its derivative. With `real` all w
 * are; a real w gets the same bits without. */
INLINE Complex newton(int n, int ld, const Vec *restrict h, const Vec *restrict inverse, Complex w, int real,
                      Vec *restrict work)
{
    Vec *restrict x = work, *restrict dx = work + n, *restrict y = work + 2 * n, *restrict dy = work + 3 * n;
    x[n - 1] = all(1), dx[n - 1] = all(0), y[n - 1] = all(0), dy[n - 1] = all(0);
    Complex p = {all(0), all(0)}, d = p;
    for (int i = n - 1; i >= 0; i--) {
        const Vec *row = h + i * ld;
        p.re = (row[i] - w.re) * x[i];
        d.re = minus((row[i] - w.re) * dx[i], all(1), x[i]);
        if (!real) {
            p.re = plus(p.re, w.im, y[i]);
            p.im = minus((row[i] - w.re) * y[i], w.im, x[i]);
            d.re = plus(d.re, w.im, dy[i]);
            d.im = minus((row[i] - w.re) * dy[i], w.im, dx[i]) - y[i];
        }
        for (int j = i + 1; j < n; j++) {
            p.re = plus(p.re, row[j], x[j]);
            d.re = plus(d.re, row[j], dx[j]);
            if (!real) {
                p.im = plus(p.im, row[j], y[j]);
                d.im = plus(d.im, row[j], dy[j]);
            }
        }
        if (i == 0)
            break;
        x[i - 1] = p.re * inverse[i], dx[i - 1] = d.re * inverse[i];
        if (!real)
            y[i - 1] = p.im * inverse[i], dy[i - 1] = d.im * inverse[i];
    }
    const Mask on_line = w.im == 0.0;
    const Complex off = quotient(p, d);
    return (Complex){pick(on_line, p.re / d.re, off.re), pick(on_line, all(0), off.im)};
}

/* Better eigenvalues of the Hessenberg matrix h. A step that is not small beside the distance of the
 * nearest neighbour is not taken. `work` holds 7 n vectors. */
static void polish(int n, int ld, const Vec *restrict h, Vec *restrict re, Vec *restrict im,
                   Vec *restrict work)
{
    Vec *restrict new_re = work + 4 * n, *restrict new_im = work + 5 * n, *restrict inverse = work + 6 * n;
    for (int j = 1; j < n; j++)
        inverse[j] = -1.0 / h[j * ld + j - 1];
    for (int k = 0; k < n; k++) {
        const Complex w = {re[k], im[k]};
        const Mask lower = w.im < 0.0;
        new_re[k] = w.re, new_im[k] = w.im;
        if (any(~lower)) {
            const Complex step = any(w.im != 0.0) ? newton(n, ld, h, inverse, w, 0, work)
                                                  : newton(n, ld, h, inverse, w, 1, work);
            Complex others = {all(0), all(0)};
            Vec nearest = all(INFINITY);
            for (int j = 0; j < n; j++) {
                if (j == k)
                    continue;
                const Vec x = w.re - re[j], y = w.im - im[j], square = plus(x * x, y, y);
                nearest = smaller(nearest, square);
                const Vec inverse = 1.0 / square;
                others.re = plus(others.re, x, inverse);
                others.im = minus(others.im, y, inverse);
            }
            /* 1 - step * others */
            const Complex keep = {plus(minus(all(1), step.re, others.re), step.im, others.im),
                                  minus(minus(all(0), step.re, others.im), step.im, others.re)};
            const Complex move = quotient(step, keep);
            const Vec size = plus(move.re * move.re, move.im, move.im);
            const Mask take = (16.0 * size < nearest) & ~lower;
            const Mask on_line = w.im == 0.0;
            new_re[k] = pick(take, w.re - move.re, w.re);
            new_im[k] = pick(take & ~on_line, w.im - move.im, w.im);
        }
        if (k > 0) {
            new_re[k] = pick(lower, new_re[k - 1], new_re[k]);
            new_im[k] = pick(lower, -new_im[k - 1], new_im[k]);
        }
    }
    for (int k = 0; k < n; k++) {
        re[k] = new_re[k];
        im[k] = new_im[k];
    }
}

#endif
