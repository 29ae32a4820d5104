/* Condition numbers |x| |y| / |y^H x| of eigenvalues with right and left eigenvectors x and y.
 *
 * Orthogonal matrices keep them, so x and y may be those of the Schur form, which one rotation for each
 * of its blocks of two rows makes a complex triangle: back substitution, no iteration. There x ends and
 * y begins with a one in the same row, so y^H x = 1 and nothing cancels. Balancing does not keep them:
 * where it scaled a matrix, its basis takes the vectors back to the matrix as it was.
 * G. H. Golub, C. F. Van Loan, Matrix Computations, 4th ed., sections 7.2.2 and 7.6.4.
 */
#ifndef HIPUQ_CONDITIONS_H
#define HIPUQ_CONDITIONS_H

#include <float.h>
#include <math.h>

#include "eigen.h"
#include "lanes.h"

/* Complex numbers in parts: a matrix, or a vector. */
typedef struct {
    Vec *restrict re, *restrict im;
} Parts;

/* (a, b) times the unitary matrix [p, -q; q, conj p], in place; q is real. */
INLINE void turn_pair(Parts t, int a, int b, Vec pre, Vec pim, Vec q)
{
    const Vec are = t.re[a], aim = t.im[a], bre = t.re[b], bim = t.im[b];
    t.re[a] = plus(minus(are * pre, aim, pim), bre, q);
    t.im[a] = plus(plus(aim * pre, are, pim), bim, q);
    t.re[b] = minus(plus(bre * pre, bim, pim), are, q);
    t.im[b] = minus(minus(bim * pre, bre, pim), aim, q);
}

/* Turn the blocks of two rows of a Schur form into triangles. The diagonal is that of `w` from now on,
 * and what lies below it means nothing. */
static void to_triangle(int n, int rows, int ld, Parts t, Parts w)
{
    for (int i = 0; i < rows; i++)
        for (int j = 0; j < n; j++)
            t.im[i * ld + j] = all(0);
    for (int k = 0; k + 1 < n; k++) {
        const int own = k * ld + k, below = own + ld;
        const Vec c = t.re[below];
        const Mask block = c != 0.0;
        if (!any(block))
            continue;
        /* Its eigenvector (w - d, c), scaled to length one; (1, 0) in the other lanes. */
        const Vec x = w.re[k] - t.re[below + 1], y = w.im[k];
        const Vec scale = 1.0 / pick(block, larger(larger(size_of(x), size_of(y)), size_of(c)), all(1));
        const Vec xs = x * scale, ys = y * scale, cs = c * scale;
        const Vec inverse = 1.0 / root_of(pick(block, plus(plus(xs * xs, ys, ys), cs, cs), all(1)));
        const Vec pre = pick(block, xs * inverse, all(1)), pim = pick(block, ys * inverse, all(0));
        const Vec q = pick(block, cs * inverse, all(0));
        /* The adjoint from the left does to rows what [conj p, -q; q, p] from the right does to columns. */
        for (int j = 0; j < n - k; j++)
            turn_pair(t, own + j, below + j, pre, -pim, q);
        for (int i = 0; i <= k + 1; i++)
            turn_pair(t, i * ld + k, i * ld + k + 1, pre, pim, q);
        for (int i = n; i < rows; i++)
            turn_pair(t, i * ld + k, i * ld + k + 1, pre, pim, q);
    }
}

/* Put 1 / (w_k - w_i) below the diagonal. Where two eigenvalues are the same to rounding, their distance
 * is taken as that. */
static void put_gaps(int n, int ld, Parts t, Parts w)
{
    for (int k = 1; k < n; k++)
        for (int i = 0; i < k; i++) {
            const Vec re = w.re[k] - w.re[i], im = w.im[k] - w.im[i];
            const Vec size = size_of(w.re[k]) + size_of(w.re[i]) + size_of(w.im[k]) + size_of(w.im[i]);
            const Vec least = 0.25 * DBL_EPSILON * size + 1e-140, square = plus(re * re, im, im);
            const Mask apart = square > least * least;
            const Vec inverse = 1.0 / pick(apart, square, least);
            t.re[k * ld + i] = pick(apart, re * inverse, inverse);
            t.im[k * ld + i] = pick(apart, -im * inverse, all(0));
        }
}

/* The sum of a_j b_j, entries of a `stride` apart. */
INLINE void product(int count, Parts a, int at, int stride, Parts b, int from, Vec *re, Vec *im)
{
    Vec rr = all(0), ii = all(0), ri = all(0), ir = all(0);
    for (int j = 0; j < count; j++, at += stride) {
        rr = plus(rr, a.re[at], b.re[from + j]);
        ii = plus(ii, a.im[at], b.im[from + j]);
        ri = plus(ri, a.re[at], b.im[from + j]);
        ir = plus(ir, a.im[at], b.re[from + j]);
    }
    *re = rr - ii;
    *im = ri + ir;
}

/* Squared length of the right eigenvector k, which is written to rows 0 to k of x. */
INLINE Vec right_vector(int k, int ld, Parts t, Parts x)
{
    Vec length = all(1), re, im;
    x.re[k] = all(1);
    x.im[k] = all(0);
    for (int i = k - 1; i >= 0; i--) {
        const Vec gap_re = t.re[k * ld + i], gap_im = t.im[k * ld + i];
        product(k - i, t, i * ld + i + 1, 1, x, i + 1, &re, &im);
        x.re[i] = minus(re * gap_re, im, gap_im);
        x.im[i] = plus(im * gap_re, re, gap_im);
        length = plus(plus(length, x.re[i], x.re[i]), x.im[i], x.im[i]);
    }
    return length;
}

/* Squared length of the left eigenvector k, which is written to rows k to n - 1 of y, conjugate. */
INLINE Vec left_vector(int n, int k, int ld, Parts t, Parts y)
{
    Vec length = all(1), re, im;
    y.re[k] = all(1);
    y.im[k] = all(0);
    for (int j = k + 1; j < n; j++) {
        const Vec gap_re = t.re[j * ld + k], gap_im = t.im[j * ld + k];
        product(j - k, t, k * ld + j, ld, y, k, &re, &im);
        y.re[j] = minus(im * gap_im, re, gap_re);
        y.im[j] = -plus(im * gap_re, re, gap_im);
        length = plus(plus(length, y.re[j], y.re[j]), y.im[j], y.im[j]);
    }
    return length;
}

/* Eigenvalues w and their condition numbers, infinite where they are beyond double precision. `t` has
 * room for 2 n rows and holds the matrices, which are overwritten; `copy` holds n ld vectors, `work` 11 n,
 * `down` n. Returns the lanes in which the iteration did not end. */
static Mask conditions_of(int n, int ld, Parts t, Vec *restrict copy, Vec *restrict work, Vec *restrict down,
                          Parts w, Vec *restrict condition)
{
    const Vec up = put_near_one(n, ld, t.re);
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++)
            t.re[(n + i) * ld + j] = all(i == j);
    balance(n, 2 * n, ld, t.re);
    Mask scaled = whole(0);
    for (int i = 0; i < n; i++) {
        const Vec factor = t.re[(n + i) * ld + i];
        scaled |= factor != 1.0;
        down[i] = 1.0 / factor;
    }
    const int rows = any(scaled) ? 2 * n : n;
    to_hessenberg(n, rows, ld, t.re, work);
    memcpy(copy, t.re, (size_t)(n * ld) * sizeof(Vec));
    const Mask failed = to_schur(n, rows, ld, t.re);
    read_blocks(n, ld, t.re, w.re, w.im);
    to_triangle(n, rows, ld, t, w);
    put_gaps(n, ld, t, w);
    const Parts x = {work, work + n};
    for (int k = 0; k < n; k++) {
        Vec xx = right_vector(k, ld, t, x), xx_scaled = all(0), yy_scaled = all(0), re, im;
        for (int i = n; i < rows; i++) {
            product(k + 1, t, i * ld, 1, x, 0, &re, &im);
            xx_scaled = plus(plus(xx_scaled, re, re), im, im);
        }
        Vec yy = left_vector(n, k, ld, t, x);
        for (int i = k; i < n; i++)
            x.im[i] = -x.im[i];
        for (int i = n; i < rows; i++) {
            product(n - k, t, i * ld + k, 1, x, k, &re, &im);
            const Vec inverse = down[i - n];
            re = re * inverse * inverse;
            im = im * inverse * inverse;
            yy_scaled = plus(plus(yy_scaled, re, re), im, im);
        }
        /* The rounding of the sweeps is that of the balanced matrix, so its own number counts too. */
        const Vec balanced = root_of(xx) * root_of(yy), given = root_of(xx_scaled) * root_of(yy_scaled);
        const Vec own = pick(scaled, larger(balanced, given), balanced);
        const Mask sound = (own <= 1e150) & (xx > 1e-290) & (yy > 1e-290)
            & (~scaled | ((xx_scaled > 1e-290) & (yy_scaled > 1e-290)));
        condition[k] = pick(sound, larger(own, all(1)), all(INFINITY));
    }
    /* The members of a complex pair share the larger number. */
    for (int k = 0; k + 1 < n; k++) {
        const Mask pair = w.im[k] > 0.0;
        const Vec larger_one = larger(condition[k], condition[k + 1]);
        condition[k] = pick(pair, larger_one, condition[k]);
        condition[k + 1] = pick(pair, larger_one, condition[k + 1]);
    }
    polish(n, ld, copy, w.re, w.im, work);
    for (int k = 0; k < n; k++) {
        w.re[k] *= up;
        w.im[k] *= up;
    }
    return failed;
}

#endif
