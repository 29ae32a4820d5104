/* The kernel for one instruction set, TARGET: avx512, avx2 or baseline. */
#include <stdlib.h>
#include <string.h>

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
    Vec *matrix, *work, *re, *im, *key;
} Room;

static Room room_of(int n)
{
    Room room = {0};
    /* An odd distance of rows spreads a column over the sets of the cache. */
    room.ld = n | 1;
    const size_t matrix = (size_t)(n + 2) * (size_t)room.ld, vectors = matrix + 6 * (size_t)n;
    room.block = malloc((vectors + 1) * sizeof(Vec));
    if (!room.block)
        return room;
    const uintptr_t address = (uintptr_t)room.block;
    room.matrix = (Vec *)((address + sizeof(Vec) - 1) / sizeof(Vec) * sizeof(Vec));
    memset(room.matrix, 0, vectors * sizeof(Vec));
    room.work = room.matrix + matrix;
    room.re = room.work + 3 * n;
    room.im = room.re + n;
    room.key = room.im + n;
    return room;
}

static int eigenvalues(int64_t samples, int64_t n, const double *matrices, double *values, uint8_t *failed)
{
    const Room room = room_of((int)n);
    if (!room.block)
        return -1;
    for (int64_t first = 0; first < samples; first += LANES) {
        for (int64_t i = 0; i < n; i++)
            for (int64_t j = 0; j < n; j++)
                room.matrix[i * room.ld + j] = load(matrices + i * n + j, n * n, first, samples);
        const Mask lost = eigenvalues_of((int)n, room.ld, room.matrix, room.work, room.re, room.im);
        for (int lane = 0; lane < LANES && first + lane < samples; lane++) {
            double *out = values + 2 * n * (first + lane);
            failed[first + lane] = lost[lane] != 0;
            for (int64_t k = 0; k < n; k++) {
                out[2 * k] = room.re[k][lane];
                out[2 * k + 1] = room.im[k][lane];
            }
        }
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

static int undamped(const HipuqBatch *batch, double threshold, double filter_radius, double zero,
                    const HipuqModes *modes)
{
    const int n = (int)batch->size;
    const Room room = room_of(n);
    if (!room.block)
        return -1;
    const Roots roots = {room.re, room.im, room.key};
    for (int64_t first = 0; first < batch->samples; first += LANES) {
        assemble(batch, first, room.ld, room.matrix, room.work);
        const Sample sample = sample_of(n, room.ld, room.matrix, batch->mechanisms, first, batch->samples);
        const Mask lost = eigenvalues_of(n, room.ld, room.matrix, room.work, room.re, room.im);
        Mask known = ~lost & take_mechanisms(n, roots, sample.mechanisms, zero * sample.norm);
        known &= known_sides(n, roots, threshold, filter_radius * sample.norm);
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

const HipuqKernel JOIN(hipuq_, TARGET) = {TEXT(TARGET), LANES, eigenvalues, undamped, degrees};
