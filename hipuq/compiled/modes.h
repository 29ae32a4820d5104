/* Modes, verdicts and margins of undamped samples from the eigenvalues w of their stiffness.
 *
 * The rules are those of hipuq/cea/undamped.py. What bounds the errors of rounding is the uniform radius of the
 * family or, where there is none, the condition number of each root; a sample that is not cleared so stays
 * open, for those who know more.
 */
#ifndef HIPUQ_MODES_H
#define HIPUQ_MODES_H

#include <float.h>
#include <math.h>

#include "lanes.h"

static const double TWO_PI = 6.28318530717958647692;

/* Roots of LANES samples: w = re + i im, how far each may be from its true place, and a key by which modes
 * are put in order. */
typedef struct {
    Vec *restrict re, *restrict im, *restrict radius, *restrict key;
} Roots;

/* Numbers that belong to a sample as a whole. */
typedef struct {
    Vec norm, trace; /* of A */
    Mask mechanisms;
} Sample;

static Sample sample_of(int n, int ld, const Vec *restrict a, const int64_t *mechanisms, int64_t first,
                        int64_t samples)
{
    Sample sample = {all(0), all(0), whole(0)};
    for (int i = 0; i < n; i++) {
        sample.trace += a[i * ld + i];
        for (int j = 0; j < n; j++)
            sample.norm = plus(sample.norm, a[i * ld + j], a[i * ld + j]);
    }
    sample.norm = root_of(sample.norm);
    for (int lane = 0; lane < LANES; lane++)
        sample.mechanisms[lane] = mechanisms[first + lane < samples ? first + lane : samples - 1];
    return sample;
}

INLINE Vec modulus(Vec re, Vec im) { return root_of(plus(re * re, im, im)); }

/* Frequency and growth rate of a root: the parts of sqrt w over 2 pi, and of i sqrt w. */
INLINE void mode_of(Vec re, Vec im, Vec *frequency, Vec *growth)
{
    const Vec size = modulus(re, im);
    /* The larger part by a sum, the smaller one from the product: nothing cancels. */
    const Vec large = root_of(0.5 * (size + size_of(re)));
    const Vec small = size_of(im) / (2.0 * pick(large > 0.0, large, all(1)));
    const Mask right = re >= 0.0;
    const Vec still = pick(right, large, small), turn = pick(right, small, large);
    *frequency = still / TWO_PI;
    *growth = pick(im > 0.0, -turn, turn);
}

/* Mark the declared number of smallest roots by the key -inf, the others by 0. Returns the lanes in which
 * all of them are within `zero` or, with `own`, within their radius. */
static Mask take_mechanisms(int n, Roots roots, Mask count, Vec zero, int own)
{
    Mask fits = whole(-1);
    for (int k = 0; k < n; k++)
        roots.key[k] = all(0);
    for (int64_t taken = 0; any(count > taken); taken++) {
        Vec least = all(INFINITY), bound = zero;
        Mask where = whole(-1);
        for (int k = 0; k < n; k++) {
            const Vec size = modulus(roots.re[k], roots.im[k]);
            const Mask less = (roots.key[k] == 0.0) & (size < least);
            least = pick(less, size, least);
            if (own)
                bound = pick(less, larger(zero, roots.radius[k]), bound);
            where = pick_whole(less, whole(k), where);
        }
        const Mask wanted = count > taken;
        for (int k = 0; k < n; k++)
            roots.key[k] = pick(wanted & (where == whole(k)), all(-INFINITY), roots.key[k]);
        fits &= ~wanted | (least <= bound);
    }
    return fits;
}

/* The lanes in which every root's side is beyond its error. Without a threshold: a complex root farther
 * from the real line, a real one whose disc touches neither zero nor another root's disc. */
static Mask known_sides(int n, Roots roots, double threshold)
{
    Mask known = whole(-1);
    for (int i = 0; i < n; i++) {
        const Mask rigid = roots.key[i] < 0.0;
        const Vec re = roots.re[i], im = roots.im[i], radius = roots.radius[i], size = modulus(re, im);
        const Mask real = im == 0.0;
        if (threshold > 0.0) {
            Vec frequency, growth;
            mode_of(re, im, &frequency, &growth);
            const Vec error = radius / (2.0 * root_of(pick(size > 0.0, size, all(1))));
            known &= rigid | ((size_of(growth - threshold) > error) & (size > radius));
            continue;
        }
        Mask apart = size > radius;
        for (int j = 0; j < n; j++) {
            if (j == i)
                continue;
            const Vec x = re - roots.re[j], y = im - roots.im[j], reach = radius + roots.radius[j];
            apart &= (plus(x * x, y, y) > reach * reach) | (roots.key[j] < 0.0);
        }
        known &= rigid | pick_whole(real, apart, size_of(im) > radius);
    }
    return known;
}

/* Put the roots in the order of their modes: mechanisms, then real roots below zero by growth rate, then
 * by frequency; equal ones stay as they come, so of a pair the decaying one is first. */
static void put_in_order(int n, Roots roots)
{
    for (int k = 0; k < n; k++) {
        const Vec re = roots.re[k], size = modulus(re, roots.im[k]);
        const Mask still = (roots.im[k] == 0.0) & (re < 0.0);
        /* Re sqrt w squared and doubled; the same to the last bit in both members of a pair. */
        const Vec square = pick(re >= 0.0, size + re, roots.im[k] * roots.im[k] / (size + size_of(re)));
        const Vec key = pick(still, 1.0 / re, square);
        roots.key[k] = pick(roots.key[k] < 0.0, roots.key[k], key);
    }
    int calm = 0; /* odd-even transposition: two rounds without a change and all is in order */
    for (int round = 0; calm < 2; round++) {
        Mask changed = whole(0);
        for (int k = round & 1; k + 1 < n; k += 2) {
            const Vec key = roots.key[k], re = roots.re[k], im = roots.im[k];
            const Mask swap = key > roots.key[k + 1];
            changed |= swap;
            roots.key[k] = pick(swap, roots.key[k + 1], key);
            roots.re[k] = pick(swap, roots.re[k + 1], re);
            roots.im[k] = pick(swap, roots.im[k + 1], im);
            roots.key[k + 1] = pick(swap, key, roots.key[k + 1]);
            roots.re[k + 1] = pick(swap, re, roots.re[k + 1]);
            roots.im[k + 1] = pick(swap, im, roots.im[k + 1]);
        }
        calm = any(changed) ? 0 : calm + 1;
    }
}

/* Scale of the roots other than mechanisms: their mean; the norm over the root of their number where
 * divergence makes them add up to nearly nothing. */
static Vec scale_of(int n, Sample sample)
{
    Vec rest;
    for (int lane = 0; lane < LANES; lane++)
        rest[lane] = (double)(n - sample.mechanisms[lane]);
    const Vec mean = sample.trace / rest, size = larger(sample.norm / root_of(rest), all(DBL_MIN));
    return pick(mean > 1e-3 * size, mean, size);
}

/* Margin without a threshold, of roots in order. Neighbours count only where all are real and positive:
 * a complex pair or a root below zero gives a smaller number. */
static Vec gap_margin(int n, Roots roots, Vec scale)
{
    Vec least = all(INFINITY), nearest = all(INFINITY), widest = all(0), before = all(-INFINITY);
    for (int k = 0; k < n; k++) {
        const Mask free = roots.key[k] > -INFINITY, real = free & (roots.im[k] == 0.0);
        least = pick(real, smaller(least, roots.re[k]), least);
        nearest = pick(real, smaller(nearest, size_of(roots.re[k] - before)), nearest);
        before = pick(real, roots.re[k], before);
        widest = pick(free, larger(widest, 2.0 * size_of(roots.im[k])), widest);
    }
    const Vec wide = widest / scale, near = nearest / scale;
    const Vec squared = pick(widest > 0.0, -larger(wide * wide, all(DBL_MIN)), near * near);
    return smaller(squared, least / scale);
}

#endif
