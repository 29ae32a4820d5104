"""Small results as analyses have them, for tests of their figures."""

import itertools

import numpy as np
import xarray as xr

ANY = {"long_name": "probability: any mode unstable", "units": "1"}
ONE = {"long_name": "probability: mode unstable", "units": "1"}
DAMPING = np.linspace(0.0, 0.02, 5)
FALLING = np.array([0.9, 0.5, 0.25, 0.05, 0.0])


def swept(probability=FALLING, width=0.1, *, dim="damping_ratio", at=DAMPING, overall=False, **attrs):
    """Return results over a parameter; NaN is unknown."""
    values = np.asarray(probability, dtype=float)
    known = np.nan_to_num(values, nan=0.5)
    reach = np.where(np.isnan(values), 1.0, width)
    ends = {"": values, "_low": np.clip(known - reach, 0, 1), "_high": np.clip(known + reach, 0, 1)}
    end = "_overall" if overall else ""
    data = {f"probability{end}{key}": (dim, value, ANY) for key, value in ends.items()}
    over = f'["{dim}"]'
    return xr.Dataset(data, coords={dim: at}, attrs={"confidence": 0.95, "over": over} | attrs)


def over_two(values, x="friction", y="damping_ratio"):
    """Return results over two parameters, (y, x)."""
    rows, columns = np.shape(values)
    coords = {y: np.linspace(0, 0.01, rows), x: np.linspace(0, 0.1, columns)}
    return xr.Dataset({"probability": ((y, x), values, ANY)}, coords=coords)


def on_grid(values, name="any_unstable", x="friction", y="damping_ratio", **attrs):
    """Return outcomes whose samples make a grid, (y, x), shuffled."""
    rows, columns = np.shape(values)
    ys, xs = np.meshgrid(np.linspace(0, 0.01, rows), np.linspace(0, 0.1, columns), indexing="ij")
    data = {
        name: ("sample", np.ravel(values).astype(float), attrs),
        x: ("sample", xs.ravel()),
        y: ("sample", ys.ravel()),
    }
    return xr.Dataset(data).isel(sample=np.random.default_rng(1).permutation(rows * columns))


def patterns(oscillators=4, counts=(2, 3, 4), seed=0):
    """Return results of any_unstable stratified over contact patterns."""
    contact = np.array(
        [
            [i in chosen for i in range(oscillators)]
            for count in counts
            for chosen in itertools.combinations(range(oscillators), count)
        ]
    )
    number = contact.sum(axis=1)
    probability = np.random.default_rng(seed).uniform(0.2, 0.7, len(contact))
    groups = [probability[number == count] for count in counts]
    mean = np.array([group.mean() for group in groups])
    summed = {
        "probability_mean": mean,
        "probability_mean_low": mean - 0.05,
        "probability_mean_high": mean + 0.05,
        "probability_min": np.array([group.min() for group in groups]),
        "probability_max": np.array([group.max() for group in groups]),
    }
    data = {"probability": ("pattern", probability, ANY)}
    data |= {name: ("count", values, ANY) for name, values in summed.items()}
    coords = {
        "pattern": np.arange(1, len(contact) + 1),
        "in_contact": ("pattern", number),
        "contact": (("pattern", "oscillator"), contact),
        "oscillator": np.arange(1, oscillators + 1),
        "count": list(counts),
    }
    return xr.Dataset(data, coords=coords, attrs={"confidence": 0.95})


def by_mode(modes=4, seed=0, **options):
    """Return results of unstable stratified over contact patterns; the first mode is always stable."""
    table = patterns(**options)
    number = table.sizes["pattern"]
    values = np.random.default_rng(seed).uniform(0, 1, (number, modes))
    values[:, 0] = 0.0
    coords = {name: table[name] for name in ("in_contact", "contact")} | {"mode": np.arange(1, modes + 1)}
    return xr.Dataset({"probability": (("pattern", "mode"), values, ONE)}, coords=coords)


def literature(value, low=np.nan, high=np.nan, sources=None, units="1"):
    """Return published figures."""
    value, low, high = np.broadcast_arrays(np.atleast_1d(value), low, high)
    names = sources or [f"source {i}" for i in range(len(value))]
    said = {"long_name": "published", "units": units}
    data = {"value": value, "low": low, "high": high}
    return xr.Dataset({key: ("source", own, said) for key, own in data.items()}, coords={"source": names})
