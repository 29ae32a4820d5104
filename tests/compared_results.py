"""Comparisons of methods with made up runs, summed up as `hipuq.compare` does, for tests of reports."""

import chaospy as cp
import numpy as np
import xarray as xr

import hipuq
from hipuq.comparison import Reference
from hipuq.comparison.dataset import dataset
from hipuq.comparison.record import Record, Run

BUDGETS = (64, 256, 1024)
REPLICATES = 200
TRUTH = 0.4
PER_EVALUATION = 50e-6
"""Time of one evaluation in the made up runs [s]."""


def spread(size=1.0, power=0.5, bias=0.0, width=1.96, beside=0.0, per=PER_EVALUATION):
    """Return how a contender does: its error, interval and time of a run of n evaluations.

    Parameters
    ----------
    size, power : float
        Its error is normal, with a standard deviation of ``size * n**-power``.
    bias : float
        Its mean error.
    width : float or None
        Half its interval over the standard deviation; None: it gives none.
    beside, per : float
        Time beside the model, time of an evaluation [s].
    """
    return {"size": size, "power": power, "bias": bias, "width": width, "beside": beside, "per": per}


CONTENDERS = {
    "random": spread(0.5),
    "twin": spread(0.5),
    "lhs": spread(0.5, 0.6, beside=1e-4),
    "chaos": spread(0.6, width=1.2, beside=0.2),
    "shifted": spread(0.5, bias=0.1, width=None),
}
"""Random sampling, the same again, a better one, one that is dear and too narrow, one that is biased."""


def compared(
    contenders=CONTENDERS,
    truth=TRUTH,
    *,
    limits=None,
    budgets=BUDGETS,
    replicates=REPLICATES,
    entries=None,
    dims=(),
    lost=None,
    title="",
    units="1",
):
    """Return a comparison with made up runs, summed up as `hipuq.compare` does.

    Parameters
    ----------
    contenders : dict
        Name -> as from `spread`.
    truth : float or dict
        The reference; one by parameter for indices.
    limits : float, optional
        Half the width of its limits.
    entries : dict, optional
        Name -> what else is said of a contender, such as its budgets.
    lost : tuple, optional
        Contender and budget at which three replicates have no estimate.
    """
    model = hipuq.models.two_dof()
    inputs = model.inputs(friction=cp.Uniform(0.0, 0.5), k1=hipuq.relative(cp.Uniform(-0.1, 0.1)))
    told = {name: {"method": "monte_carlo", **(entries or {}).get(name, {})} for name in contenders}
    value = np.array(list(truth.values()) if isinstance(truth, dict) else truth)
    ends = (None, None) if limits is None else (value - limits, value + limits)
    race = hipuq.comparison.race(
        model,
        inputs,
        told,
        of="any_unstable",
        reference=Reference(value, *ends, source="made up"),
        budgets=list(budgets),
        replicates=replicates,
    )
    coords = {dim: list(truth) for dim in dims}
    labels = {"name": "ST" if dims else "probability", "contender": "random", "units": units}
    labels |= {"long_name": "probability: any mode unstable", "dims": list(dims), "coords": coords}
    record = Record(None, {}, labels=labels)
    rng = np.random.default_rng(1)
    for one in race.contenders:
        how = contenders[one.name]
        for budget in one.sizes:
            n = one.evaluations(budget)
            deviation = how["size"] * n ** -how["power"]
            for k in range(one.replicates):
                estimate = value + how["bias"] + deviation * rng.normal(size=value.shape)
                if (one.name, budget) == lost and k < 3:
                    estimate = estimate * np.nan
                half = np.nan if how["width"] is None else how["width"] * deviation
                spent = how["per"] * n
                whole = how["beside"] + spent * 1.1
                parts = (part.tolist() for part in (estimate, estimate - half, estimate + half))
                record.add(Run(one.name, budget, k, one.sizes[budget], n, whole, spent, 1, *parts))
    reference = np.stack([value, *(value if end is None else end for end in ends)])
    return dataset(race, record, reference, 7).assign_attrs(title=title)


def integrated():
    """Return what is said of a contender whose model has the friction integrated."""
    model = hipuq.models.two_dof()
    return {
        "method": "monte_carlo",
        "model": hipuq.integrate_friction(model, cp.Uniform(0.0, 0.5)),
        "inputs": model.inputs(k1=hipuq.relative(cp.Uniform(-0.1, 0.1))),
        "of": "probability",
    }


def with_comparisons(tree, **races):
    """Return a results tree with comparisons."""
    groups = {f"compare/{name}": race for name, race in races.items()}
    rest = {path: node.to_dataset(inherit=False) for path, node in tree.subtree_with_keys if path != "."}
    return xr.DataTree.from_dict({"/": tree.to_dataset()} | rest | groups)


def named_race():
    """Return the comparison of all `CONTENDERS`, one of which leaves out a budget."""
    entries = {
        "lhs": {"options": {"sampler": "latin_hypercube"}},
        "chaos": {"budgets": [64, 256], "options": {"confidence": 0.9}},
    }
    return compared(entries=entries, title="Two masses")


def index_race():
    """Return a comparison of indices of two parameters."""
    ways = {"random": spread(0.5), "sobol": spread(0.3, beside=1e-3)}
    return compared(ways, {"friction": 0.8, "k1": 0.3}, dims=("parameter",))
