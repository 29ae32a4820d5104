/* Eigenvalues of small dense real matrices, one in each lane: balancing, Householder reduction to
 * Hessenberg form, then Francis' implicit double shift.
 *
 * G. H. Golub, C. F. Van Loan, Matrix Computations, 4th ed., sections 7.4.3, 7.5.5 and 7.5.6; balancing:
 * B. N. Parlett, C. Reinsch, Numer. Math. 13 (1969) 293. Every lane has its own active block and its own
 * shifts; a sweep runs over the union of the blocks and does nothing, exactly, in a lane whose block does
 * not reach so far. A matrix of n rows is stored by rows, `ld` vectors apart.
 */
#ifndef HIPUQ_EIGEN_H
#define HIPUQ_EIGEN_H

#include <float.h>

#include "lanes.h"

enum { MOST_SWEEPS = 60 }; /* for one eigenvalue; two or three are usual */

/* Scale rows and columns by powers of two until their sums are alike. */
static void balance(int n, int ld, Vec *restrict a)
{
    Mask changed = whole(-1);
    for (int round = 0; round < 10 && any(changed); round++) {
        changed = whole(0);
        for (int i = 0; i < n; i++) {
            Vec column = all(0), row = all(0);
            for (int j = 0; j < n; j++) {
                column += size_of(a[j * ld + i]);
                row += size_of(a[i * ld + j]);
            }
            const Vec own = size_of(a[i * ld + i]);
            column -= own;
            row -= own;
            Mask act = (column > 0.0) & (row > 0.0);
            const Vec quotient = pick(act, row, all(1)) / pick(act, column, all(1));
            const Mask half = (exponent_of(quotient) + 1) >> 1;
            Vec up = power_of_two(half), down = power_of_two(-half);
            act &= column * up + row * down < 0.95 * (column + row);
            if (!any(act))
                continue;
            changed |= act;
            up = pick(act, up, all(1));
            down = pick(act, down, all(1));
            for (int j = 0; j < n; j++)
                a[i * ld + j] *= down;
            for (int j = 0; j < n; j++)
                a[j * ld + i] *= up;
        }
    }
}

/* A reflector I - t v v^T with v = (1, x2 / (x1 - b), ...) that turns x into (b, 0, ...).
 * `live` are the lanes in which there is something to turn; elsewhere t and scale are 0. */
typedef struct {
    Vec beta, tau, scale;
    Mask live;
} Reflector;

INLINE Reflector reflector(Vec head, Vec tail_squared, Mask among)
{
    Reflector r;
    r.beta = -with_sign(root_of(plus(tail_squared, head, head)), head);
    r.live = among & (tail_squared > 0.0);
    const Vec difference = pick(r.live, head - r.beta, all(1));
    const Vec safe = pick(r.live, r.beta, all(1));
    const Vec inverse = 1.0 / (safe * difference);
    r.tau = pick(r.live, -difference * difference * inverse, all(0));
    r.scale = pick(r.live, safe * inverse, all(0));
    return r;
}

/* Reduce to Hessenberg form. Both sides of a reflector in one pass, A - v z^T - y v^T, on the rows that
 * it turns; the rows above know its right side only. `work` holds 3 n vectors. */
static void to_hessenberg(int n, int ld, Vec *restrict a, Vec *restrict work)
{
    Vec *restrict v = work, *restrict z = work + n, *restrict y = work + 2 * n;
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
        for (int i = 0; i <= k; i++) {
            Vec *restrict row = a + i * ld;
            Vec dot = all(0);
            for (int j = k + 1; j < n; j++)
                dot = plus(dot, row[j], v[j]);
            dot *= r.tau;
            for (int j = k + 1; j < n; j++)
                row[j] = minus(row[j], dot, v[j]);
        }
        for (int j = k + 1; j < n; j++)
            z[j] = all(0);
        Vec form = all(0); /* v^T A v */
        for (int i = k + 1; i < n; i++) {
            const Vec *restrict row = a + i * ld;
            Vec dot = all(0);
            for (int j = k + 1; j < n; j++) {
                dot = plus(dot, row[j], v[j]);
                z[j] = plus(z[j], row[j], v[i]);
            }
            y[i] = dot;
            form = plus(form, dot, v[i]);
        }
        const Vec half = 0.5 * r.tau * r.tau * form;
        for (int j = k + 1; j < n; j++) {
            z[j] = minus(r.tau * z[j], half, v[j]);
            y[j] = minus(r.tau * y[j], half, v[j]);
        }
        for (int i = k + 1; i < n; i++) {
            Vec *restrict row = a + i * ld;
            for (int j = k + 1; j < n; j++)
                row[j] = minus(minus(row[j], v[i], z[j]), y[i], v[j]);
        }
    }
}

/* The active block of each lane, rows lo to hi, and the first column of its shifted square. */
typedef struct {
    Mask lo, hi;
    Vec p, q, r;
} Block;

/* One double-shift sweep of rows first to last, the union of the blocks. */
static void sweep(int ld, Vec *restrict h, const Block *block, int first, int last)
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
        Vec *restrict x = h + first * ld + k;
        if (three) {
            for (int j = k; j <= last; j++) {
                const Vec s = plus(plus(a[j], v2, b[j]), v3, c[j]);
                a[j] = minus(a[j], s, t1);
                b[j] = minus(b[j], s, t2);
                c[j] = minus(c[j], s, t3);
            }
            /* From below, because the next reflector waits for the last rows. */
            const int end = k + 3 < last ? k + 3 : last;
            x = h + end * ld + k;
            for (int i = end; i >= first; i--, x -= ld) {
                const Vec s = plus(plus(x[0], v2, x[1]), v3, x[2]);
                x[0] = minus(x[0], s, t1);
                x[1] = minus(x[1], s, t2);
                x[2] = minus(x[2], s, t3);
            }
        } else {
            for (int j = k; j <= last; j++) {
                const Vec s = plus(a[j], v2, b[j]);
                a[j] = minus(a[j], s, t1);
                b[j] = minus(b[j], s, t2);
            }
            for (int i = first; i <= last; i++, x += ld) {
                const Vec s = plus(x[0], v2, x[1]);
                x[0] = minus(x[0], s, t1);
                x[1] = minus(x[1], s, t2);
            }
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

/* Reduce a Hessenberg matrix to blocks of one and two rows. Returns the lanes that did not get there. */
static Mask to_schur(int n, int ld, Vec *restrict h)
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
        sweep(ld, h, &block, first, last);
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

/* Eigenvalues of the matrices in `a`, which is overwritten; `work` holds 3 n vectors. Returns the lanes
 * in which the iteration did not end. */
static Mask eigenvalues_of(int n, int ld, Vec *restrict a, Vec *restrict work, Vec *restrict re, Vec *restrict im)
{
    Vec largest = all(0);
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++)
            largest = larger(largest, size_of(a[i * ld + j]));
    /* Powers of two put the largest entry near 1, so squares neither overflow nor vanish. */
    Mask exponent = (largest > 0.0) & exponent_of(largest);
    exponent = pick_whole(exponent > 1022, whole(1022), pick_whole(exponent < -1022, whole(-1022), exponent));
    const Vec down = power_of_two(-exponent), up = power_of_two(exponent);
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++)
            a[i * ld + j] *= down;
    balance(n, ld, a);
    to_hessenberg(n, ld, a, work);
    const Mask failed = to_schur(n, ld, a);
    read_blocks(n, ld, a, re, im);
    for (int k = 0; k < n; k++) {
        re[k] *= up;
        im[k] *= up;
    }
    return failed;
}

#endif
