/* Eigenvalues of small dense real matrices, one in each lane: balancing, Householder reduction to
 * Hessenberg form, then Francis' implicit double shift.
 *
 * G. H. Golub, C. F. Van Loan, Matrix Computations, 4th ed., sections 7.4.3, 7.5.5 and 7.5.6. Every lane
 * has its own active block and its own shifts; a sweep runs over the union of the blocks and does nothing,
 * exactly, in a lane whose block does not reach so far. A matrix of n rows is stored by rows, `ld` vectors
 * apart.
 *
 * Rows n to rows - 1 behind a matrix are multiplied by what it is multiplied by from the right, but not
 * from the left: the identity there becomes the basis in which the matrix ends.
 */
#ifndef HIPUQ_EIGEN_H
#define HIPUQ_EIGEN_H

#include <float.h>
#include <string.h>

#include "balance.h"
#include "lanes.h"
#include "polish.h"

enum { MOST_SWEEPS = 60 }; /* for one eigenvalue; two or three are usual */

/* A reflector I - t v v^T with v = (1, x2 / (x1 - b), ...) that turns x into (b, 0, ...).
 * `live` are the lanes in which there is something to turn; elsewhere t and scale are 0. */
typedef struct {
    Vec beta, tau, scale;
    Mask live;
} Reflector;

INLINE Reflector reflector(Vec head, Vec tail_squared, Mask among)
{
    Reflector r;
    const Vec squared = plus(tail_squared, head, head);
    r.beta = -with_sign(root_of(squared), head);
    /* Where squares lose digits there is nothing to turn: the largest entry of the matrix is near 1. */
    r.live = among & (tail_squared > 0.0) & (squared > 1e-280);
    const Vec difference = pick(r.live, head - r.beta, all(1));
    const Vec safe = pick(r.live, r.beta, all(1));
    /* Two divisions where one would do: with one, what sweeps do to eigenvalues is 40 % worse. */
    r.tau = pick(r.live, -difference / safe, all(0));
    r.scale = pick(r.live, 1.0 / difference, all(0));
    return r;
}

/* Multiply a row by I - t v v^T from the right; v starts at entry `first`. */
INLINE void turn_row(int n, int first, Vec *restrict row, const Vec *restrict v, Vec tau)
{
    Vec dot = all(0);
    for (int j = first; j < n; j++)
        dot = plus(dot, row[j], v[j]);
    dot *= tau;
    for (int j = first; j < n; j++)
        row[j] = minus(row[j], dot, v[j]);
}

/* Reduce to Hessenberg form, one reflector from the left and from the right after the other: both in one
 * pass, A - v z^T - y v^T, is no faster here and a third less accurate. `v` holds n vectors. */
static void to_hessenberg(int n, int rows, int ld, Vec *restrict a, Vec *restrict v)
{
    for (int k = 0; k + 2 < n; k++) {
        Vec tail = all(0);
        for (int i = k + 2; i < n; i++)
            tail = plus(tail, a[i * ld + k], a[i * ld + k]);
        const Vec head = a[(k + 1) * ld + k];
        const Reflector r = reflector(head, tail, whole(-1));
        a[(k + 1) * ld + k] = pick(r.live, r.beta, head);
        v[k + 1] = all(1);
        for (int i = k + 2; i < n; i++) {
            v[i] = a[i * ld + k] * r.scale;
            a[i * ld + k] = all(0);
        }
        for (int j = k + 1; j < n; j++) {
            Vec dot = all(0);
            for (int i = k + 1; i < n; i++)
                dot = plus(dot, a[i * ld + j], v[i]);
            dot *= r.tau;
            for (int i = k + 1; i < n; i++)
                a[i * ld + j] = minus(a[i * ld + j], dot, v[i]);
        }
        for (int i = 0; i < rows; i++)
            turn_row(n, k + 1, a + i * ld, v, r.tau);
    }
}

/* The active block of each lane, rows lo to hi, and the first column of its shifted square. */
typedef struct {
    Mask lo, hi;
    Vec p, q, r;
} Block;

INLINE void turn_two(Vec *x, Vec v2, Vec t1, Vec t2)
{
    const Vec s = plus(x[0], v2, x[1]);
    x[0] = minus(x[0], s, t1);
    x[1] = minus(x[1], s, t2);
}

INLINE void turn_three(Vec *x, Vec v2, Vec v3, Vec t1, Vec t2, Vec t3)
{
    const Vec s = plus(plus(x[0], v2, x[1]), v3, x[2]);
    x[0] = minus(x[0], s, t1);
    x[1] = minus(x[1], s, t2);
    x[2] = minus(x[2], s, t3);
}

/* What a sweep turns: columns up to `right`, rows from `top`, and those behind the matrix. */
typedef struct {
    int top, right, behind, rows;
} Reach;

/* One double-shift sweep of rows first to last, the union of the blocks. */
static void sweep(int ld, Vec *restrict h, const Block *block, int first, int last, Reach reach)
{
    Vec p = block->p, q = block->q, r = block->r;
    for (int k = first; k < last; k++) {
        const Mask at = whole(k), start = block->lo == at;
        const int three = k + 2 <= last;
        Vec *restrict left = h + k * ld + k - 1; /* the column that the reflector clears */
        if (k > first) {
            p = pick(start, block->p, left[0]);
            q = pick(start, block->q, left[ld]);
            r = three ? pick(start, block->r, pick(block->hi >= at + 2, left[2 * ld], all(0))) : all(0);
        }
        const Reflector turn = reflector(p, plus(r * r, q, q), (block->lo <= at) & (block->hi > at));
        const Vec v2 = q * turn.scale, v3 = r * turn.scale;
        const Vec t1 = turn.tau, t2 = t1 * v2, t3 = t1 * v3;
        if (k > first) {
            const Mask inside = turn.live & ~start;
            left[0] = pick(inside, turn.beta, left[0]);
            left[ld] = pick(inside, all(0), left[ld]);
            if (three)
                left[2 * ld] = pick(inside, all(0), left[2 * ld]);
        }
        Vec *restrict a = h + k * ld, *restrict b = a + ld, *restrict c = b + ld;
        Vec *restrict x = h + reach.top * ld + k;
        if (three) {
            for (int j = k; j <= reach.right; j++) {
                const Vec s = plus(plus(a[j], v2, b[j]), v3, c[j]);
                a[j] = minus(a[j], s, t1);
                b[j] = minus(b[j], s, t2);
                c[j] = minus(c[j], s, t3);
            }
            /* From below, because the next reflector waits for the last rows. */
            const int end = k + 3 < last ? k + 3 : last;
            x = h + end * ld + k;
            for (int i = end; i >= reach.top; i--, x -= ld)
                turn_three(x, v2, v3, t1, t2, t3);
            x = h + reach.behind * ld + k;
            for (int i = reach.behind; i < reach.rows; i++, x += ld)
                turn_three(x, v2, v3, t1, t2, t3);
        } else {
            for (int j = k; j <= reach.right; j++) {
                const Vec s = plus(a[j], v2, b[j]);
                a[j] = minus(a[j], s, t1);
                b[j] = minus(b[j], s, t2);
            }
            for (int i = reach.top; i <= last; i++, x += ld)
                turn_two(x, v2, t1, t2);
            x = h + reach.behind * ld + k;
            for (int i = reach.behind; i < reach.rows; i++, x += ld)
                turn_two(x, v2, t1, t2);
        }
    }
}

/* Clear subdiagonal entries that are rounding, and leave behind blocks of one or two rows at the end.
 * Returns the last row that any lane still works on, 0 when all are done. */
static int deflate(int ld, Vec *restrict h, Block *block, Mask *sweeps)
{
    for (;;) {
        int last = 0;
        for (int lane = 0; lane < LANES; lane++)
            last = block->hi[lane] > last ? (int)block->hi[lane] : last;
        block->lo = whole(0);
        for (int k = 1; k <= last; k++) {
            const Vec beside = size_of(h[(k - 1) * ld + k - 1]) + size_of(h[k * ld + k]);
            const Vec entry = h[k * ld + k - 1];
            const Mask at = whole(k), rounding = (size_of(entry) <= DBL_EPSILON * beside) & (block->hi >= at);
            h[k * ld + k - 1] = pick(rounding, all(0), entry);
            block->lo = pick_whole(rounding, at, block->lo);
        }
        const Mask one = (block->lo == block->hi) & (block->hi > 0);
        const Mask two = (block->lo == block->hi - 1) & (block->hi > 0);
        if (!any(one | two))
            return last;
        block->hi += one + two + two; /* true is -1 */
        *sweeps &= ~(one | two);
    }
}

/* Set the first column of (H - s)(H - s') with the eigenvalues s, s' of the last two rows, or twice the
 * one nearer to the last entry where they are real; every tenth sweep something else. Returns the first
 * row of any block. */
static int shift(int n, int ld, const Vec *restrict h, Block *block, Mask sweeps)
{
    Vec a = all(1), b = a, c = a, d = a, beyond = a, t11 = a, t12 = a, t21 = a, t22 = a, t32 = a;
    int first = n;
    for (int lane = 0; lane < LANES; lane++) {
        const int lo = (int)block->lo[lane], hi = (int)block->hi[lane];
        if (hi <= 0)
            continue;
        first = lo < first ? lo : first;
        const Vec *top = h + lo * ld + lo, *end = h + (hi - 1) * ld + hi - 1;
        a[lane] = end[0][lane], b[lane] = end[1][lane];
        c[lane] = end[ld][lane], d[lane] = end[ld + 1][lane];
        beyond[lane] = end[-1][lane];
        t11[lane] = top[0][lane], t12[lane] = top[1][lane];
        t21[lane] = top[ld][lane], t22[lane] = top[ld + 1][lane];
        t32[lane] = top[2 * ld + 1][lane];
    }
    block->lo = pick_whole(block->hi > 0, block->lo, whole(2 * n));
    const Mask odd = (sweeps == 10) | (sweeps == 20) | (sweeps == 30) | (sweeps == 40) | (sweeps == 50);
    const Vec odd_size = size_of(c) + size_of(beyond);
    a = pick(odd, 0.75 * odd_size + d, a);
    b = pick(odd, -0.4375 * odd_size, b);
    c = pick(odd, odd_size, c);
    d = pick(odd, a, d);
    const Vec half = 0.5 * (a - d), mean = 0.5 * (a + d), square = plus(half * half, b, c);
    const Mask real = square >= 0.0;
    const Vec root = root_of(size_of(square)), above = mean + root, below = mean - root;
    const Vec near = pick(size_of(above - d) <= size_of(below - d), above, below);
    const Vec re = pick(real, near, mean), im = pick(real, all(0), root);
    const Vec from = t11 - re, sum = size_of(from) + im + size_of(t21);
    const Vec inverse = 1.0 / pick(sum > 0.0, sum, all(1)), down = t21 * inverse;
    const Vec p = plus(plus(down * t12, from, from * inverse), im, im * inverse);
    const Vec q = down * (t11 + t22 - re - re), r = down * t32;
    const Vec size = size_of(p) + size_of(q) + size_of(r);
    const Vec scale = 1.0 / pick(size > 0.0, size, all(1));
    block->p = p * scale, block->q = q * scale, block->r = r * scale;
    return first;
}

/* Reduce a Hessenberg matrix to blocks of one and two rows; what lies above them is right only if it is
 * asked for by `rows`, n or more. Returns the lanes that did not get there. */
static Mask to_schur(int n, int rows, int ld, Vec *restrict h)
{
    Block block = {.lo = whole(0), .hi = whole(n - 1)};
    Mask sweeps = whole(0), failed = whole(0);
    for (;;) {
        const int last = deflate(ld, h, &block, &sweeps);
        if (last < 1)
            return failed;
        const Mask lost = (block.hi > 0) & (sweeps > MOST_SWEEPS);
        if (any(lost)) {
            failed |= lost;
            block.hi &= ~lost;
            continue;
        }
        const int first = shift(n, ld, h, &block, sweeps);
        sweeps -= block.hi > 0;
        sweep(ld, h, &block, first, last, rows ? (Reach){0, n - 1, n, rows} : (Reach){first, last, 0, 0});
    }
}

/* Read the eigenvalues of the blocks; of a complex pair the one above the real line comes first. */
static void read_blocks(int n, int ld, const Vec *restrict h, Vec *restrict re, Vec *restrict im)
{
    Mask taken = whole(0); /* lanes in which this row is the second one of its block */
    for (int k = 0; k < n; k++) {
        const Vec a = h[k * ld + k];
        re[k] = pick(taken, re[k], a);
        im[k] = pick(taken, im[k], all(0));
        if (k + 1 == n)
            break;
        const Vec b = h[k * ld + k + 1], c = h[(k + 1) * ld + k], d = h[(k + 1) * ld + k + 1];
        const Mask pair = (c != 0.0) & ~taken;
        const Vec half = 0.5 * (a - d), mean = 0.5 * (a + d);
        const Vec most = larger(size_of(b), size_of(c)), least = smaller(size_of(b), size_of(c));
        const Vec other = pick((b < 0.0) != (c < 0.0), -least, least);
        const Vec size = larger(size_of(half), most), scale = pick(size > 0.0, size, all(1));
        const Vec square = plus(half / scale * half, most / scale, other);
        const Mask real = square >= 0.0;
        const Vec root = root_of(scale) * root_of(size_of(square));
        const Vec far = half + with_sign(root, half);
        const Mask apart = far != 0.0;
        const Vec second = pick(apart, minus(d, most / pick(apart, far, all(1)), other), d);
        re[k] = pick(pair, pick(real, d + far, mean), re[k]);
        im[k] = pick(pair & ~real, root, im[k]);
        re[k + 1] = pick(real, second, mean);
        im[k + 1] = pick(real, all(0), -root);
        taken = pair;
    }
}

/* Eigenvalues of the matrices in `a`, which is overwritten; `copy` holds as many vectors, `work` 11 n.
 * Returns the lanes in which the iteration did not end. */
static Mask eigenvalues_of(int n, int ld, Vec *restrict a, Vec *restrict copy, Vec *restrict work,
                           Vec *restrict re, Vec *restrict im)
{
    const Vec up = put_near_one(n, ld, a);
    balance(n, n, ld, a);
    to_hessenberg(n, n, ld, a, work);
    memcpy(copy, a, (size_t)(n * ld) * sizeof(Vec));
    const Mask failed = to_schur(n, 0, ld, a);
    read_blocks(n, ld, a, re, im);
    polish(n, ld, copy, re, im, work);
    for (int k = 0; k < n; k++) {
        re[k] *= up;
        im[k] *= up;
    }
    return failed;
}

#endif
