"""A small results tree with everything that a report can tell, as a study writes it."""

import functools
import json

import chaospy as cp
import numpy as np
import xarray as xr

import hipuq
from hipuq.evaluation import How
from hipuq.methods import METHODS
from hipuq.occurring import frequency_ranges, verdict_counts
from hipuq.rounds import completed
from hipuq.sweeping import gathered

PRESET = "oberst2016-calibrated"
RATIOS = (0.0, 0.005, 0.01)
FRICTION = cp.Uniform(0.0, 0.4)
CONTACT = hipuq.ContactPatterns(in_contact=(8, 9))


def root(**report):
    """Return the attributes of the root of a results tree."""
    attrs = {"title": "Ring & <friends>", "description": "", "study": "small", "seed": 3}
    attrs |= {"study_file": "title = 'Ring'\n", "hipuq_version": "0.1.0", "report": json.dumps(report)}
    return xr.Dataset(attrs=attrs)


def tree(groups, **report):
    """Return groups, as ``{"analysis/of": Dataset}``, as the results tree of a study."""
    return xr.DataTree.from_dict({"/": root(**report)} | groups)


def swept():
    """Return the groups of an analysis of verdicts, stratified, over the damping ratio."""
    model = hipuq.models.ring(PRESET)
    inputs = model.inputs(friction=FRICTION, contact=CONTACT)
    stages = METHODS["monte_carlo"].split({"stratify": "contact"})
    parts = {"any_unstable": [], "unstable": [], "frequencies": [], "verdicts": []}
    for ratio in RATIOS:
        (outcomes,) = completed(
            model, inputs, METHODS["monte_carlo"], 6, 1, of=["any_unstable", "unstable"], stages=stages,
            at=[{"damping_ratio": ratio}], keep=["frequency"], how=How(progress=False),
        )  # fmt: skip
        for of in ("any_unstable", "unstable"):
            parts[of].append(hipuq.estimate("monte_carlo", outcomes, inputs, of=of))
        parts["frequencies"].append(frequency_ranges(outcomes))
        parts["verdicts"].append(verdict_counts(outcomes))
    return {name: gathered(own, {"damping_ratio": RATIOS}) for name, own in parts.items()}


def integrated():
    """Return the groups of an analysis with friction integrated, at 1 % modal damping."""
    model = hipuq.models.ring(PRESET, damping_ratio=0.01)
    exact = hipuq.integrate_friction(model, FRICTION)
    inputs = exact.inputs(contact=CONTACT)
    samples = hipuq.design("monte_carlo", inputs, n=1, rng=1, stratify="contact")
    outcomes = hipuq.evaluate(exact, samples, keep=["probability", "onset", "interval"], progress=False)
    return {
        "probability": hipuq.estimate("monte_carlo", outcomes, inputs, of="probability"),
        "fragility": hipuq.fragility(outcomes, np.linspace(0.0, 0.4, 21)),
        "onsets": outcomes[["onset"]],
        "friction_limit": hipuq.friction_limit(outcomes, [0.01, 0.5]),
        "verdicts": verdict_counts(outcomes),
    }


def drivers():
    """Return the groups of an analysis of indices, at 1 % modal damping."""
    model = hipuq.models.ring(PRESET, damping_ratio=0.01)
    inputs = model.inputs(friction=FRICTION, mass=hipuq.relative(cp.Uniform(-0.1, 0.1), each="oscillator"))
    return {"any_unstable": hipuq.run(model, inputs, method="sobol", n=64, of="any_unstable", rng=1)}


@functools.cache
def everything():
    """Return a tree with all groups; not to be changed."""
    analyses = {"squeak": swept(), "exact": integrated(), "drivers": drivers()}
    groups = {f"{name}/{key}": own for name, groups in analyses.items() for key, own in groups.items()}
    for quantity in ("incidence", "critical_friction", "squeak_frequency", "friction"):
        groups[f"literature/{quantity}"] = hipuq.literature(quantity)
    made = tree(groups, damping_ratio=0.01, mode_names={"12": "11"})
    made.attrs["sources"] = json.dumps({"squeak": {"friction": "assumed <here>"}})
    made.attrs["versions"] = json.dumps({"python": "3.12"})
    made.attrs["command"] = "hipuq run small --seed 3"
    return made


def without(whole, *names):
    """Return the tree without groups, by their path or the first part of it."""
    groups = {
        path.lstrip("/"): node.to_dataset(inherit=False)
        for path, node in ((node.path, node) for node in whole.subtree)
        if node.has_data or path == "/"
    }
    kept = {
        path or "/": one
        for path, one in groups.items()
        if not any(path == name or path.startswith(f"{name}/") for name in names)
    }
    return xr.DataTree.from_dict(kept)
