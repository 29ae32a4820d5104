/* Lanes: one double of each of several samples in a vector register, all samples in step.
 *
 * Whatever a lane computes comes from the numbers of its own sample alone, so results do not depend on
 * the company of a sample. The sign of a zero may: nothing here may ask for it.
 */
#ifndef HIPUQ_LANES_H
#define HIPUQ_LANES_H

#include <math.h>
#include <stdint.h>

#if defined(__x86_64__) || defined(_M_X64)
#include <immintrin.h>
#endif

#if defined(__AVX512F__)
#define LANES 8
#elif defined(__AVX2__)
#define LANES 4
#else
#define LANES 2
#endif

typedef double Vec __attribute__((vector_size(8 * LANES)));
typedef int64_t Mask __attribute__((vector_size(8 * LANES))); /* -1 where true; also whole numbers */

#define INLINE static inline __attribute__((always_inline))

INLINE Vec all(double x) { return (Vec){0} + x; }

INLINE Mask whole(int64_t x) { return (Mask){0} + x; }

INLINE Vec pick(Mask which, Vec yes, Vec no) { return (Vec)((which & (Mask)yes) | (~which & (Mask)no)); }

INLINE Mask pick_whole(Mask which, Mask yes, Mask no) { return (which & yes) | (~which & no); }

INLINE Vec size_of(Vec x) { return (Vec)((Mask)x & INT64_MAX); }

INLINE Vec larger(Vec a, Vec b) { return pick(a > b, a, b); }

INLINE Vec smaller(Vec a, Vec b) { return pick(a < b, a, b); }

INLINE Vec with_sign(Vec size, Vec of) { return pick(of < 0.0, -size, size); }

/* c + a b and c - a b, rounded once where the processor can. The compiler is told to fuse nothing by
 * itself (-ffp-contract=off), so that bits depend on the instruction set alone. */
INLINE Vec plus(Vec c, Vec a, Vec b)
{
#if defined(__AVX512F__)
    return (Vec)_mm512_fmadd_pd((__m512d)a, (__m512d)b, (__m512d)c);
#elif defined(__AVX2__)
    return (Vec)_mm256_fmadd_pd((__m256d)a, (__m256d)b, (__m256d)c);
#else
    return c + a * b;
#endif
}

INLINE Vec minus(Vec c, Vec a, Vec b)
{
#if defined(__AVX512F__)
    return (Vec)_mm512_fnmadd_pd((__m512d)a, (__m512d)b, (__m512d)c);
#elif defined(__AVX2__)
    return (Vec)_mm256_fnmadd_pd((__m256d)a, (__m256d)b, (__m256d)c);
#else
    return c - a * b;
#endif
}

INLINE Vec root_of(Vec x)
{
#if defined(__AVX512F__)
    return (Vec)_mm512_sqrt_pd((__m512d)x);
#elif defined(__AVX2__)
    return (Vec)_mm256_sqrt_pd((__m256d)x);
#elif defined(__SSE2__)
    return (Vec)_mm_sqrt_pd((__m128d)x);
#else
    for (int lane = 0; lane < LANES; lane++)
        x[lane] = sqrt(x[lane]);
    return x;
#endif
}

INLINE int any(Mask which)
{
#if defined(__AVX512DQ__)
    return _mm512_movepi64_mask((__m512i)which) != 0;
#else
    int64_t found = 0;
    for (int lane = 0; lane < LANES; lane++)
        found |= which[lane];
    return found != 0;
#endif
}

/* The binary exponent of a positive number, and the power of two of an exponent from -1022 to 1023. */
INLINE Mask exponent_of(Vec x) { return ((Mask)x >> 52) - 1023; }

INLINE Vec power_of_two(Mask exponent) { return (Vec)((exponent + 1023) << 52); }

#endif
