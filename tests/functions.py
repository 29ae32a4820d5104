"""Functions with known moments and Sobol indices, as models of three or more uniform inputs."""

from dataclasses import dataclass

import chaospy as cp
import numpy as np
import xarray as xr

import hipuq


@dataclass(frozen=True)
class Known:
    """A function and what is known of it; indices by parameter in the order of the inputs.

    Second-order ones are a symmetric matrix without a diagonal.
    """

    inputs: hipuq.Inputs
    model: object
    mean: float
    variance: float
    first: np.ndarray
    total: np.ndarray
    second: np.ndarray


def ishigami(a: float = 7.0, b: float = 0.1) -> Known:
    """Return sin x1 + a sin^2 x2 + b x3^4 sin x1 (Ishigami and Homma 1990), inputs U(-pi, pi).

    Main effects: x1 (1 + b pi^4/5)^2 / 2, x2 a^2/8, x3 none; x1 and x3 together b^2 pi^8 (1/18 - 1/50).
    """
    inputs = hipuq.Inputs(**{f"x{i}": cp.Uniform(-np.pi, np.pi) for i in (1, 2, 3)})

    def model(samples: xr.Dataset) -> xr.Dataset:
        x1, x2, x3 = (samples[f"x{i}"] for i in (1, 2, 3))
        return xr.Dataset({"y": np.sin(x1) + a * np.sin(x2) ** 2 + b * x3**4 * np.sin(x1)})

    one, two = 0.5 * (1 + b * np.pi**4 / 5) ** 2, a**2 / 8
    both = b**2 * np.pi**8 * (1 / 18 - 1 / 50)
    variance = one + two + both
    first, total = np.array([one, two, 0.0]) / variance, np.array([one + both, two, both]) / variance
    second = np.full((3, 3), np.nan)
    for (i, j), value in {(0, 1): 0.0, (0, 2): both / variance, (1, 2): 0.0}.items():
        second[i, j] = second[j, i] = value
    return Known(inputs, model, a / 2, variance, first, total, second)


def sobol_g(a: tuple[float, ...] = (0.0, 1.0, 4.5)) -> Known:
    """Return the product of (|4 x - 2| + a) / (1 + a) over inputs U(0, 1) (Saltelli and Sobol 1995).

    Each factor has mean 1 and variance 1 / (3 (1 + a)^2).
    """
    inputs = hipuq.Inputs(**{f"x{i}": cp.Uniform(0.0, 1.0) for i in range(1, len(a) + 1)})

    def model(samples: xr.Dataset) -> xr.Dataset:
        y = xr.ones_like(samples["x1"])
        for i, one in enumerate(a, 1):
            y = y * (abs(4 * samples[f"x{i}"] - 2) + one) / (1 + one)
        return xr.Dataset({"y": y})

    own = 1 / (3 * (1 + np.array(a)) ** 2)
    variance = np.prod(1 + own) - 1
    total = own * np.prod(1 + own) / (1 + own) / variance
    second = np.outer(own, own) / variance
    np.fill_diagonal(second, np.nan)
    return Known(inputs, model, 1.0, variance, own / variance, total, second)
