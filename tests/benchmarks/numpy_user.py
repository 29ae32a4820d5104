"""Complex eigenvalue analysis of the ring as a user of NumPy writes it: what the benchmarks compare with.

Equations of Oberst et al. (INTER-NOISE 2016, equations 2 to 7), vectorised over samples; eigenvalues by
`numpy.linalg.eigvals` in blocks, on a pool of threads with one thread of BLAS each; a tolerance tells real
from complex. Nothing is taken from hipuq, and nothing of what it proves or counts is here.
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

Array = NDArray[np.float64]
Outcomes = dict[str, NDArray[np.generic]]

MASS = 22.22
"""[kg]"""

TOLERANCE = 1e-6
"""Smallest imaginary part that counts as one, relative to the largest eigenvalue of the matrix."""

BLOCK = 256
"""Samples at a time: of 64 to 20,000 about the fastest, by a few per cent."""


def evaluate(
    samples: Mapping[str, Array],
    *,
    damping_ratio: float = 0.0,
    everything: bool = True,
    threads: int = 2,
    block: int = BLOCK,
) -> Outcomes:
    """Return the outcomes of the samples: verdicts, and frequencies and growth rates if wanted.

    Parameters
    ----------
    samples : mapping
        ``friction`` (s,), ``spring_stiffness``, ``spring_angle`` (s, 10), ``contact_stiffness``,
        ``contact_angle`` (s, 9), in SI units and degrees; every oscillator is in contact.
    damping_ratio : float
        Modal damping of the frictionless modes.
    everything : bool
        Whether frequencies [Hz] and growth rates [1/s] of the modes, sorted, are wanted beside
        ``any_unstable``.
    threads, block : int
        Threads, and samples that each takes at a time.

    Returns
    -------
    dict of array
    """
    size = len(samples["friction"])
    found: Outcomes = {"any_unstable": np.empty(size, bool)}
    if everything:
        found |= {name: np.empty((size, 18)) for name in ("frequency", "growth_rate")}
        found |= {"unstable": np.empty((size, 18), bool)}

    def one(start: int) -> None:
        rows = slice(start, start + block)
        part = {name: values[rows] for name, values in samples.items()}
        outcomes = _damped(part, damping_ratio) if damping_ratio else _undamped(part, everything)
        for name in found:
            found[name][rows] = outcomes[name]

    with threadpool_limits(1, "blas"), ThreadPoolExecutor(threads) as pool:
        list(pool.map(one, range(0, size, block)))
    return found


def _undamped(samples: Mapping[str, Array], everything: bool) -> Outcomes:
    """Solve ``M^-1 K y = w y``: stable if every w is real and positive."""
    w = np.linalg.eigvals(system(samples))
    tolerance = TOLERANCE * np.abs(w).max(axis=1, keepdims=True)
    flutter = np.abs(w.imag) > tolerance
    if not everything:
        return {"any_unstable": (flutter | (w.real < -tolerance)).any(axis=1)}
    root = np.sqrt(np.where(flutter, w, w.real + 0j))
    growth = np.where(flutter, -root.imag, np.where(w.real < -tolerance, root.imag, 0.0))
    return _by_frequency(root.real / (2 * np.pi), growth)


def _damped(samples: Mapping[str, Array], damping_ratio: float) -> Outcomes:
    """Solve ``(l^2 + l C + K) y = 0``, masses divided out: stable if every l lies left of the axis."""
    stiffness = system(samples)
    squares, modes = np.linalg.eigh(system({**samples, "friction": np.zeros_like(samples["friction"])}))
    damping = (modes * (2 * damping_ratio * np.sqrt(squares))[:, None, :]) @ modes.transpose(0, 2, 1)
    s, n = stiffness.shape[:2]
    companion = np.zeros((s, 2 * n, 2 * n))
    companion[:, :n, n:] = np.eye(n)
    companion[:, n:, :n] = -stiffness
    companion[:, n:, n:] = -damping
    # One of each pair; no mode is overdamped, so there are n of them.
    roots = np.linalg.eigvals(companion)
    order = np.argsort(-roots.imag, axis=1)[:, :n]
    upper = np.take_along_axis(roots, order, axis=1)
    return _by_frequency(upper.imag / (2 * np.pi), upper.real)


def _by_frequency(frequency: Array, growth: Array) -> Outcomes:
    """Return the outcomes of modes by ascending frequency, the decaying one of a pair first."""
    order = np.lexsort((growth, frequency), axis=1)
    frequency, growth = (np.take_along_axis(part, order, axis=1) for part in (frequency, growth))
    unstable = growth > 0
    return {
        "frequency": frequency,
        "growth_rate": growth,
        "unstable": unstable,
        "any_unstable": np.asarray(unstable.any(axis=1)),
    }


def system(samples: Mapping[str, Array]) -> Array:
    """Return ``M^-1 K`` of the samples, (s, 18, 18)."""
    k, a = samples["spring_stiffness"] / MASS, np.deg2rad(samples["spring_angle"])
    kc, b = samples["contact_stiffness"] / MASS, np.deg2rad(samples["contact_angle"])
    mu = samples["friction"][:, None]
    size, n = kc.shape
    cos, sin = np.cos(a), np.sin(a)
    springs = (k * cos * cos, k * cos * sin, k * cos * sin, k * sin * sin)
    cos, sin = np.cos(b), np.sin(b)
    # Friction pulls along (-sin b, cos b), a right angle ahead of the normal (cos b, sin b).
    x, y = kc * (cos - mu * sin), kc * (sin + mu * cos)
    contacts = (x * cos, x * sin, y * cos, y * sin)
    blocks = np.zeros((size, n, 2, n, 2))
    i, j = np.arange(n), np.arange(n - 1)
    for entry, (spring, contact) in enumerate(zip(springs, contacts, strict=True)):
        part = blocks[:, :, entry // 2, :, entry % 2]
        part[:, i, i] = spring[:, :-1] + spring[:, 1:] + contact
        part[:, j, j + 1] = part[:, j + 1, j] = -spring[:, 1:-1]
    return blocks.reshape(size, 2 * n, 2 * n)


def seed_study(patterns: NDArray[np.bool_], draws: int, seed: int) -> Array:
    """Return the share of unstable draws of friction for each contact pattern, by a plain loop.

    Parameters
    ----------
    patterns : (p, 9) array of bool
        Oscillators in contact.
    draws : int
        Draws for each pattern, friction uniform between 0 and 0.1.
    seed : int

    Returns
    -------
    (p,) array
    """
    rng = np.random.default_rng(seed)
    share = np.empty(len(patterns))
    nominal = {
        "spring_stiffness": np.full((1, 10), 1.05e9),
        "spring_angle": 78.75 + 22.5 * np.arange(10)[None],
        "contact_angle": 180.0 + 22.5 * np.arange(9)[None],
    }
    for p, pattern in enumerate(patterns):
        contact = {"contact_stiffness": 3.98e9 * pattern[None]}
        without, whole = (system({**nominal, **contact, "friction": np.array([mu])})[0] for mu in (0.0, 1.0))
        friction_part = whole - without
        unstable = 0
        for mu in rng.uniform(0.0, 0.1, draws):
            w = np.linalg.eigvals(without + mu * friction_part)
            unstable += np.abs(w.imag).max() > TOLERANCE * np.abs(w).max()
        share[p] = unstable / draws
    return share
