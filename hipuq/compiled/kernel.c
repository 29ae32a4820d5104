/* The kernel for one instruction set, TARGET: avx512, avx2 or baseline. */
#include <stdlib.h>
#include <string.h>

#include "conditions.h"
#include "degrees.h"
#include "eigen.h"
#include "kernel.h"
#include "modes.h"
#include "pencil.h"

#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#define TEXT_(a) #a
#define TEXT(a) TEXT_(a)

/* Room for the matrices of one block and the vectors beside it, aligned for the widest registers. */
typedef struct {
    void *block;
    int ld;
    Vec *matrix, *copy, *work, *re, *im, *radius, *key;
} Room;

/* `rows` is how many a matrix takes. */
static Room room_of(int n, int rows)
{
    Room room = {0};
    /* An odd distance of rows spreads a column over the sets of the cache. */
    room.ld = n | 1;
    const size_t matrix = (size_t)(rows + 2) * (size_t)room.ld, copy = (size_t)n * (size_t)room.ld;
    const size_t vectors = matrix + copy + 15 * (size_t)n;
    room.block = malloc((vectors + 1) * sizeof(Vec));
    if (!room.block)
        return room;
    const uintptr_t address = (uintptr_t)room.block;
    room.matrix = (Vec *)((address + sizeof(Vec) - 1) / sizeof(Vec) * sizeof(Vec));
    memset(room.matrix, 0, vectors * sizeof(Vec));
    room.copy = room.matrix + matrix;
    room.work = room.copy + copy;
    room.re = room.work + 11 * n;
    room.im = room.re + n;
    room.radius = room.im + n;
    room.key = room.radius + n;
    return room;
}

/* Take LANES matrices from `first` on. */
static void take(int64_t samples, int64_t n, const double *matrices, int64_t first, const Room *room)
{
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j < n; j++)
            room->matrix[i * room->ld + j] = load(matrices + i * n + j, n * n, first, samples);
}

/* Give what `part` holds for each sample to every `stride`-th place of `out`. */
static void give(int64_t samples, int64_t n, int64_t first, const Vec *restrict part, int stride, double *out)
{
    for (int lane = 0; lane < LANES && first + lane < samples; lane++)
        for (int64_t k = 0; k < n; k++)
            out[stride * (n * (first + lane) + k)] = part[k][lane];
}

static void mark(int64_t samples, int64_t first, Mask lost, uint8_t *failed)
{
    for (int lane = 0; lane < LANES && first + lane < samples; lane++)
        failed[first + lane] = lost[lane] != 0;
}

static int eigenvalues(int64_t samples, int64_t n, const double *matrices, double *values, uint8_t *failed)
{
    const Room room = room_of((int)n, (int)n);
    if (!room.block)
        return -1;
    for (int64_t first = 0; first < samples; first += LANES) {
        take(samples, n, matrices, first, &room);
        const Mask lost = eigenvalues_of((int)n, room.ld, room.matrix, room.copy, room.work, room.re, room.im);
        give(samples, n, first, room.re, 2, values);
        give(samples, n, first, room.im, 2, values + 1);
        mark(samples, first, lost, failed);
    }
    free(room.block);
    return 0;
}

/* A matrix and its basis, both complex, and beside them the scaling by which it was balanced. */
static Room wide_room_of(int n) { return room_of(n, 2 * (2 * n + 2)); }

static Mask conditions_in(const Room *room, int n)
{
    const int half = (2 * n + 2) * room->ld;
    const Parts t = {room->matrix, room->matrix + half}, w = {room->re, room->im};
    return conditions_of(n, room->ld, t, room->copy, room->work, t.im + half, w, room->radius);
}

static int conditioned(int64_t samples, int64_t n, const double *matrices, double *values, double *condition,
                       uint8_t *failed)
{
    const Room room = wide_room_of((int)n);
    if (!room.block)
        return -1;
    for (int64_t first = 0; first < samples; first += LANES) {
        take(samples, n, matrices, first, &room);
        const Mask lost = conditions_in(&room, (int)n);
        give(samples, n, first, room.re, 2, values);
        give(samples, n, first, room.im, 2, values + 1);
        give(samples, n, first, room.radius, 1, condition);
        mark(samples, first, lost, failed);
    }
    free(room.block);
    return 0;
}

/* Write the modes of one lane. */
static void write_modes(int n, int lane, int64_t row, const Room *room, double threshold, const HipuqModes *modes)
{
    for (int k = 0; k < n; k++) {
        /* Frequencies and growth rates lie in the place of the roots by now. */
        const double growth = room->im[k][lane];
        modes->frequency[row * n + k] = room->re[k][lane];
        modes->growth_rate[row * n + k] = growth;
        modes->unstable[row * n + k] = growth > threshold ? 1.0f : 0.0f;
    }
}

static int undamped(const HipuqBatch *batch, double threshold, const HipuqBounds *bounds, const HipuqModes *modes)
{
    const int n = (int)batch->size, uniform = bounds->filter_radius > 0.0;
    const Room room = uniform ? room_of(n, n) : wide_room_of(n);
    if (!room.block)
        return -1;
    const Roots roots = {room.re, room.im, room.radius, room.key};
    for (int64_t first = 0; first < batch->samples; first += LANES) {
        assemble(batch, first, room.ld, room.matrix, room.work);
        const Sample sample = sample_of(n, room.ld, room.matrix, batch->mechanisms, first, batch->samples);
        Mask lost;
        if (uniform) {
            lost = eigenvalues_of(n, room.ld, room.matrix, room.copy, room.work, room.re, room.im);
            for (int k = 0; k < n; k++)
                room.radius[k] = bounds->filter_radius * sample.norm;
        } else {
            lost = conditions_in(&room, n);
            for (int k = 0; k < n; k++)
                room.radius[k] *= bounds->rounding * sample.norm;
        }
        Mask known = ~lost & take_mechanisms(n, roots, sample.mechanisms, bounds->zero * sample.norm, !uniform);
        known &= known_sides(n, roots, threshold);
        /* Squares of smaller or larger roots leave the range of doubles. */
        known &= (sample.norm > 1e-140) & (sample.norm < 1e140);
        put_in_order(n, roots);
        const Vec scale = scale_of(n, sample);
        Vec margin = threshold > 0.0 ? all(0) : gap_margin(n, roots, scale);
        Vec fastest = all(-INFINITY);
        for (int k = 0; k < n; k++) {
            const Mask rigid = roots.key[k] == -INFINITY;
            Vec frequency, growth;
            mode_of(roots.re[k], roots.im[k], &frequency, &growth);
            roots.re[k] = pick(rigid, all(0), frequency);
            roots.im[k] = pick(rigid, all(0), growth);
            fastest = larger(fastest, roots.im[k]);
        }
        if (threshold > 0.0)
            margin = (threshold - fastest) / root_of(scale);
        for (int lane = 0; lane < LANES && first + lane < batch->samples; lane++) {
            const int64_t row = first + lane;
            modes->open[row] = !known[lane];
            modes->margin[row] = margin[lane];
            write_modes(n, lane, row, &room, threshold, modes);
        }
    }
    free(room.block);
    return 0;
}

static void degrees(int64_t count, const double *angle, double *cosine, double *sine)
{
    for (int64_t first = 0; first < count; first += LANES) {
        Vec c, s;
        cosine_and_sine(load(angle, 1, first, count), &c, &s);
        for (int lane = 0; lane < LANES && first + lane < count; lane++) {
            cosine[first + lane] = c[lane];
            sine[first + lane] = s[lane];
        }
    }
}

const HipuqKernel JOIN(hipuq_, TARGET) = {TEXT(TARGET), LANES, eigenvalues, conditioned, undamped, degrees};
