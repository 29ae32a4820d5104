/* What the library offers; hipuq/compiled/binding.py declares the same. All strides count doubles. */
#ifndef HIPUQ_KERNEL_H
#define HIPUQ_KERNEL_H

#include <stdint.h>

/* Entries of the matrices of all samples, at places that they share: entry p of sample s is
 * values[source[p] * row_stride + s * sample_stride] at (row[p], column[p]). */
typedef struct {
    const double *values;
    const int32_t *source, *row, *column;
    int64_t places, row_stride, sample_stride, times_friction;
} HipuqTerm;

/* Undamped pencils K0 + mu K1, the sum of the terms, and a diagonal mass; mass NULL: unit mass. */
typedef struct {
    int64_t samples, size, terms;
    const HipuqTerm *term;
    const double *friction, *mass;
    int64_t friction_stride, mass_row_stride, mass_sample_stride;
    const int64_t *mechanisms;
} HipuqBatch;

/* Bounds of errors over the norm of a matrix: `filter_radius` for every eigenvalue of the family; where it
 * is 0, `rounding` times the condition number. A declared mechanism is within `zero`, or its own bound. */
typedef struct {
    double filter_radius, rounding, zero;
} HipuqBounds;

/* Outcomes: (samples, size) the first three, (samples) the others. `open` is 1
 * where double precision leaves a verdict open: nothing else is said of such a sample. */
typedef struct {
    double *frequency, *growth_rate;
    float *unstable;
    double *margin;
    uint8_t *open;
} HipuqModes;

/* Eigenvalues of (samples, n, n) matrices as (re, im) pairs, (samples, n, 2); `failed`, (samples), is 1
 * where the iteration did not end. Returns -1 where memory is short. */
typedef int HipuqEigenvalues(int64_t samples, int64_t n, const double *matrices, double *values, uint8_t *failed);

/* The same with the condition number of each eigenvalue, (samples, n); see conditions.h. */
typedef int HipuqConditioned(int64_t samples, int64_t n, const double *matrices, double *values,
                             double *condition, uint8_t *failed);

/* Modes and verdicts of undamped pencils; see modes.h. Returns -1 where memory is short. */
typedef int HipuqUndamped(const HipuqBatch *batch, double threshold, const HipuqBounds *bounds,
                          const HipuqModes *modes);

typedef void HipuqDegrees(int64_t count, const double *angle, double *cosine, double *sine);

/* The same for one instruction set. */
typedef struct {
    const char *name;
    int lanes;
    HipuqEigenvalues *eigenvalues;
    HipuqConditioned *conditioned;
    HipuqUndamped *undamped;
    HipuqDegrees *degrees;
} HipuqKernel;

#endif
