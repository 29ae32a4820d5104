"""Results of the methods sobol and chaos, made up: what figures and reports of indices are tested with."""

import json

import numpy as np
import xarray as xr

NAMES = ["friction", "contact", "spring_stiffness", "contact_stiffness", "spring_angle", "contact_angle"]
FIRST = [0.47, 0.03, 0.02, -0.012, 0.004, 0.0]
TOTAL = [0.84, 0.50, 0.47, 0.33, 0.33, 0.02]
ORDERS = {"S1": "first-order", "ST": "total-order", "S2": "second-order"}
OUTCOME = "stability margin (negative: unstable)"
ELEMENTS = [
    *(
        f"{name}[{i}]"
        for name in ("spring_stiffness", "spring_angle", "contact_stiffness")
        for i in range(1, 10)
    ),
    *(f"contact_angle[{i}]" for i in range(1, 12)),
    "friction",
    "contact",
]
REASON = "the outcome does not vary; its variance is 0"
SENTENCE = (
    "Stability margin (negative: unstable): friction explains 47 % (44 to 50 %) of the variance alone, "
    "84 % (81 to 87 %) with its interactions; the 6 parameters alone explain 51 % together"
)
"""What is said of the indices of `sobol`."""


def attrs(name, outcome=OUTCOME):
    return {"long_name": f"{ORDERS[name]} index of {outcome}", "units": "1"}


def variable(results, name, dims, values, long_name, units="1", **more):
    results[name] = (dims, values, {"long_name": long_name, "units": units} | more)


def indices(names=NAMES, first=FIRST, total=TOTAL, *, second=True, width=None):
    """Return S1, ST and S2; with intervals of a width around them if it is given."""
    first, total = (np.asarray(values, dtype=float) for values in (first, total))
    results = xr.Dataset(coords={"parameter": list(names), "parameter_2": list(names)})
    for key in ("parameter", "parameter_2"):
        results[key].attrs.update(long_name="parameter", units="1")
    pairs = np.sqrt(np.abs(np.outer(total - first, total - first))) / 4 - 0.01
    np.fill_diagonal(pairs, np.nan)
    tables = {"S1": first, "ST": total} | ({"S2": pairs} if second else {})
    for name, values in tables.items():
        dims = ("parameter", "parameter_2")[: values.ndim]
        results[name] = (dims, values, attrs(name))
        off = ~np.eye(len(values), dtype=bool) if values.ndim == 2 else np.ones(values.shape, bool)
        if np.isnan(values[off]).any():
            results[name].attrs["undefined"] = REASON
        if width is not None:
            for end, shift in (("low", -width), ("high", width)):
                results[f"{name}_{end}"] = (dims, values + shift, attrs(name))
                results[f"{name}_{end}"].attrs["long_name"] += f", {end}er limit"
    return results


def finished(results, method, evaluations=14336):
    """Return results with the counts and attributes that all have."""
    variable(results, "evaluations", (), evaluations, "model evaluations")
    variable(results, "failed", (), 0, "failed samples")
    variable(results, "undecided", (), 3, "undecided samples")
    variable(results, "seconds", (), 4.2, "time of the evaluations", "s")
    inputs = {
        "friction": {
            "how": "absolute",
            "each": False,
            "distribution": {"name": "Uniform", "kwargs": {"lower": 0.0}},
        }
    }
    said = {"hipuq_version": "0", "model": "ring", "method": method, "seed": 1, "history": "", "of": "margin"}
    return results.assign_attrs(
        said, confidence=0.95, inputs=json.dumps(inputs), options=json.dumps({"estimate": {"of": "margin"}})
    )


def sobol(
    names=NAMES, first=FIRST, total=TOTAL, *, second=True, width=0.03, budgets=(1792, 3584, 7168, 14336)
):
    results = indices(names, first, total, second=second, width=width)
    results = results.assign_coords(
        budget=("budget", list(budgets), {"long_name": "evaluations used", "units": "1"})
    )
    grow = np.sqrt(budgets[-1] / np.asarray(budgets))[:, None]
    for name in ("S1", "ST"):
        wave = 0.6 * width * np.sin(np.arange(len(budgets))[:, None] * 2 + np.arange(len(names)))
        middle = results[name].values + (grow - 1) * wave
        for end, shift in (("", 0), ("_low", -width * grow), ("_high", width * grow)):
            said = attrs(name)
            results[f"{name}_by_budget{end}"] = (("budget", "parameter"), middle + shift, said)
    variable(results, "mean", (), 0.0213, f"mean of {OUTCOME}")
    variable(results, "variance", (), 0.0009, f"variance of {OUTCOME}", "1")
    variable(results, "base_samples", (), 1022, "base samples used")
    variable(results, "dropped", (), 2, "blocks dropped for a failed or unknown sample")
    return finished(results, "sobol")


def chaos(names=NAMES, first=FIRST, total=TOTAL, *, second=True, limit=0.0, samples=600, trusted=1, seed=1):
    results = indices(names, first, total, second=second)
    rng = np.random.default_rng(seed)
    true = rng.normal(0.02, 0.03, samples)
    predicted = 0.9 * true + 0.002 + rng.normal(0, 0.01, samples)
    results = results.assign_coords(
        held_out=("held_out", np.arange(samples), {"long_name": "sample number", "units": "1"}),
        quantile=("quantile", [0.05, 0.5, 0.95], {"long_name": "probability below", "units": "1"}),
    )
    variable(results, "mean", (), 0.0213, f"mean of {OUTCOME}")
    variable(results, "variance", (), 0.0009, f"variance of {OUTCOME}", "1")
    for name, value, text in (
        ("degree", 3, "degree of the expansion"),
        ("terms", 84, "terms of the expansion"),
        ("loo", 0.112, "relative leave-one-out error"),
        ("samples_used", 2000, "samples that the expansion was fitted to"),
        ("q2", 0.884, "Q2 on held-out samples"),
    ):
        variable(results, name, (), value, text)
    for end, shift in (("", 0), ("_low", -0.001), ("_high", 0.001)):
        variable(results, f"mean_corrected{end}", (), 0.0221 + shift, f"corrected mean of {OUTCOME}")
    variable(results, "quantiles", ("quantile",), [-0.03, 0.02, 0.07], f"quantiles of {OUTCOME}")
    more = {} if limit is None else {"limit_state": limit}
    for name, values in (("true", true), ("predicted", predicted)):
        variable(results, name, ("held_out",), values, OUTCOME, **more)
    if limit is not None:
        wrong = float(((true < limit) != (predicted < limit)).mean())
        variable(results, "probability_surrogate", (), 0.262, "probability by the surrogate alone")
        for end, shift in (("", 0), ("_low", -0.02), ("_high", 0.02)):
            variable(results, f"misclassified{end}", (), wrong + shift, "misclassified held-out samples")
            variable(results, f"probability{end}", (), 0.251 + shift, f"probability: {OUTCOME} below {limit}")
    why = (
        ""
        if trusted
        else "Q2 is 0.41, below 0.8. 12 of 500 predictions lie outside the range of the samples."
    )
    variable(results, "trusted", (), np.int8(trusted), "surrogate to be trusted", reasons=why)
    return finished(results, "chaos", 2600)


def by_mode(results, modes=(16, 17, 18)):
    """Return the results over modes too, the first of them undefined."""
    over = xr.DataArray(list(modes), dims="mode", attrs={"long_name": "mode", "units": "1"})
    made = results.copy()
    for name in results.data_vars:
        if str(name).split("_")[0] in (
            "S1",
            "ST",
            "S2",
            "mean",
            "variance",
            "true",
            "predicted",
            "q2",
            "trusted",
        ):
            values = results[name].expand_dims(mode=over).astype(float)
            if str(name)[0] == "S":
                values = values.where(over != modes[0])
                values.attrs["undefined"] = f"mode {modes[0]}: the outcome does not vary"
            made[name] = values.assign_attrs(results[name].attrs | values.attrs)
    return made


def tree(**groups):
    """Return the results of analyses as the tree of a study."""
    attrs = {key: "" for key in ("title", "description", "study", "seed", "study_file", "hipuq_version")}
    root = xr.Dataset(attrs=attrs | {"report": "{}"})
    return xr.DataTree.from_dict({"/": root} | {f"{name}/margin": one for name, one in groups.items()})
