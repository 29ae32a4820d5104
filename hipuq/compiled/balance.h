/* Powers of two that suit a matrix to doubles, without rounding: all of it near 1, rows like columns.
 *
 * B. N. Parlett, C. Reinsch, Numer. Math. 13 (1969) 293. Matrices are stored as in eigen.h.
 */
#ifndef HIPUQ_BALANCE_H
#define HIPUQ_BALANCE_H

#include "lanes.h"

/* Multiply by powers of two that put the largest entry near 1, so that squares neither overflow nor
 * vanish. Returns the factor that takes eigenvalues back. */
static Vec put_near_one(int n, int ld, Vec *restrict a)
{
    Vec largest = all(0);
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++)
            largest = larger(largest, size_of(a[i * ld + j]));
    Mask exponent = (largest > 0.0) & exponent_of(largest);
    exponent = pick_whole(exponent > 1022, whole(1022), pick_whole(exponent < -1022, whole(-1022), exponent));
    const Vec down = power_of_two(-exponent);
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++)
            a[i * ld + j] *= down;
    return power_of_two(exponent);
}

/* Scale rows and columns by powers of two until their sums are alike. */
static void balance(int n, int rows, int ld, Vec *restrict a)
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
            for (int j = 0; j < rows; j++)
                a[j * ld + i] *= up;
        }
    }
}

#endif
