"""The equations of the ring in balls of as many digits as are asked for, apart from the package.

O2016, equations 2 to 7; flint's precision in bits, ``flint.ctx.prec``, is the caller's to set.
"""

import numpy as np
from flint import arb, arb_mat


def ring_matrices(v):
    """Return M^(-1/2) of K0, K1 and C of the ring from both sides, from arb values, in ms^-2, ms^-1."""
    count = len(v["mass"])
    n = 2 * count
    constant, slope = arb_mat(n, n), arb_mat(n, n)

    def unit(angle):
        return (angle / 180).cos_pi(), (angle / 180).sin_pi()

    def add(matrix, i, j, factor, row, column):
        for p in range(2):
            for q in range(2):
                weight = (v["mass"][i] * v["mass"][j]).sqrt() * 10**6
                matrix[2 * i + p, 2 * j + q] += factor * row[p] * column[q] / weight

    for k, angle, j in zip(v["spring_stiffness"], v["spring_angle"], range(count + 1), strict=True):
        along = unit(angle)
        ends = [i for i in (j - 1, j) if 0 <= i < count]
        for i in ends:
            for other in ends:
                add(constant, i, other, k if i == other else -k, along, along)
    for i in range(count):
        kc = v["contact_stiffness"][i] * v["contact"][i]
        normal, tangent = unit(v["contact_angle"][i]), unit(v["friction_angle"][i])
        add(constant, i, i, kc, normal, normal)
        add(slope, i, i, kc, tangent, normal)
    unity = arb_mat([[int(i == j) for j in range(n)] for i in range(n)])
    damping = constant * (v["stiffness_damping"] * 1000) + unity * (v["mass_damping"] / 1000)
    if v["damping_ratio"] != 0:
        # Square root by the iteration of Denman and Beavers.
        root, inverse = constant, unity
        for _ in range(14):
            root, inverse = ((root + inverse.inv()) / 2).mid(), ((inverse + root.inv()) / 2).mid()
        damping = damping + root * (2 * v["damping_ratio"])
    return constant, slope, damping


def exact_values(model, **changes):
    """Return the parameters of a ring as arb."""
    values = {name: parameter.nominal for name, parameter in model.parameters.items()} | changes
    return {
        name: [arb(float(x)) for x in value] if np.ndim(value) else arb(float(value))
        for name, value in values.items()
    }
