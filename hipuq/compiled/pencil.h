/* Assembly: the stiffness for unit mass of LANES samples, straight into lanes. */
#ifndef HIPUQ_PENCIL_H
#define HIPUQ_PENCIL_H

#include <string.h>

#include "kernel.h"
#include "lanes.h"

/* Numbers of LANES samples from `first` on; behind the last sample the last one again. */
INLINE Vec load(const double *restrict values, int64_t stride, int64_t first, int64_t samples)
{
    Vec x;
    if (stride == 0)
        return all(values[0]);
    if (stride == 1 && first + LANES <= samples) {
        memcpy(&x, values + first, sizeof x);
        return x;
    }
    for (int lane = 0; lane < LANES; lane++)
        x[lane] = values[stride * (first + lane < samples ? first + lane : samples - 1)];
    return x;
}

/* A = w_i (K0 + mu K1)_ij w_j with w = 1 / sqrt(mass). `work` holds n vectors. */
static void assemble(const HipuqBatch *batch, int64_t first, int ld, Vec *restrict a, Vec *restrict work)
{
    const int n = (int)batch->size;
    const int64_t samples = batch->samples;
    const Vec friction = load(batch->friction, batch->friction_stride, first, samples);
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++)
            a[i * ld + j] = all(0);
    for (int64_t t = 0; t < batch->terms; t++) {
        const HipuqTerm *term = batch->term + t;
        const Vec factor = term->times_friction ? friction : all(1);
        for (int64_t p = 0; p < term->places; p++) {
            const double *values = term->values + term->source[p] * term->row_stride;
            a[term->row[p] * ld + term->column[p]] += factor * load(values, term->sample_stride, first, samples);
        }
    }
    if (!batch->mass)
        return;
    for (int i = 0; i < n; i++)
        work[i] = 1.0 / root_of(load(batch->mass + i * batch->mass_row_stride, batch->mass_sample_stride,
                                     first, samples));
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++)
            a[i * ld + j] *= work[i] * work[j];
}

#endif
