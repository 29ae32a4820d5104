"""Which figures a report has, and where exact probabilities stand beside sampled ones."""

import json

import chaospy as cp
import numpy as np
import pytest
import xarray as xr

import hipuq
from hipuq.report.figures import pictures


@pytest.fixture(scope="module")
def sampled():
    model = hipuq.models.ring("oberst2016")
    inputs = model.inputs(friction=cp.Uniform(0, 0.1), contact=hipuq.ContactPatterns(in_contact=(8, 9)))
    samples = hipuq.design("monte_carlo", inputs, n=10, rng=1, stratify="contact")
    outcomes = hipuq.evaluate(model, samples, keep=["unstable"], progress=False)
    return hipuq.estimate("monte_carlo", outcomes, inputs, of="unstable")


@pytest.fixture(scope="module")
def exact(sampled):
    """Results as an exact analysis gives them: no friction in the inputs, no limits."""
    inputs, options = (json.loads(sampled.attrs[key]) for key in ("inputs", "options"))
    options["model"]["integrated"] = {"friction": inputs.pop("friction")["distribution"]}
    limits = [name for name in sampled if str(name).endswith(("_low", "_high"))]
    return sampled.drop_vars(limits).assign_attrs(
        model=f"{sampled.attrs['model']}, friction integrated",
        confidence=1.0,
        of="probability_by_mode",
        inputs=json.dumps(inputs),
        options=json.dumps(options),
    )


def tree(**groups):
    attrs = {key: "" for key in ("title", "description", "study", "seed", "study_file", "hipuq_version")}
    root = xr.Dataset(attrs=attrs | {"report": "{}"})
    named = {f"{name}/{results.attrs['of']}": results for name, results in groups.items()}
    return xr.DataTree.from_dict({"/": root} | named)


def shown(**groups):
    """Return analysis -> its occurrence figure."""
    found = list(pictures(tree(**groups)))
    assert {picture.name for picture in found} <= {"boxplots", "occurrence"}
    kept = {picture.analysis: picture for picture in found if picture.name == "occurrence"}
    # Boxes are drawn once, in the part that stands before the analyses.
    assert [picture.block for picture in found] == ["count"] * (len(found) - len(kept)) + [""] * len(kept)
    assert len(found) - len(kept) <= 1
    return kept


def has_bars(picture):
    picture.figure.draw_without_rendering()
    return any(line.get_label() == "exact" for ax in picture.figure.axes for line in ax.lines)


@pytest.mark.parametrize("order", [("drawn", "certain"), ("certain", "drawn")])
def test_exact_values_stand_in_the_figure_of_the_sampled_ones(sampled, exact, order):
    both = {"drawn": sampled, "certain": exact}
    found = shown(**{name: both[name] for name in order})
    assert list(found) == ["drawn"]
    assert has_bars(found["drawn"])
    assert "'certain'" in found["drawn"].caption


def test_sampled_results_alone(sampled):
    found = shown(drawn=sampled)
    assert not has_bars(found["drawn"])
    assert "xact" not in found["drawn"].caption


def test_exact_results_alone_have_their_own_figure(exact):
    found = shown(certain=exact)
    assert list(found) == ["certain"]
    assert "Samples" not in found["certain"].caption


def changed(results, **model):
    """Return results of a model with other options; a mapping is merged into the one there."""
    options = json.loads(results.attrs["options"])
    for key, value in model.items():
        here = options["model"].get(key)
        options["model"][key] = here | value if isinstance(value, dict) else value
    return results.assign_attrs(options=json.dumps(options))


# Another case of a model, or none that the figure could compare.
OTHERS = {
    "preset": lambda exact: exact.assign_attrs(model="ring(oberst2016-calibrated), friction integrated"),
    "not integrated": lambda exact: exact.assign_attrs(model="ring(oberst2016)"),
    "damping": lambda exact: changed(exact, nominal={"damping_ratio": 0.01}),
    "threshold": lambda exact: changed(exact, growth_threshold=20.0),
    "friction": lambda exact: changed(exact, integrated={"friction": {"kind": "chaospy"}}),
    "inputs": lambda exact: exact.assign_attrs(inputs=json.dumps({"contact": {"in_contact": [9]}})),
    "counts": lambda exact: exact.sel(count=[9]),
    "modes": lambda exact: exact.sel(mode=slice(11, 18)),
    "sampled too": lambda exact: exact.assign_attrs(confidence=0.95),
}


@pytest.mark.parametrize("name", OTHERS)
def test_another_case_is_not_drawn_beside(sampled, exact, name):
    found = shown(drawn=sampled, other=OTHERS[name](exact))
    assert list(found) == ["drawn", "other"]
    assert not any(has_bars(picture) for picture in found.values())


def test_nominal_friction_and_certificates_make_no_other_case(sampled, exact):
    other = changed(exact, nominal={"friction": 0.05}, certify="never")
    assert list(shown(drawn=sampled, other=other)) == ["drawn"]


def test_an_integrated_model_says_what_it_integrates(sampled, exact):
    """What the results above are made up to say is what the integrated model itself says."""
    model = hipuq.integrate_friction(hipuq.models.ring("oberst2016"), cp.Uniform(0, 0.1))
    assert exact.attrs["model"] == model.label
    assert json.loads(exact.attrs["options"])["model"] == json.loads(json.dumps(model.options))


def test_results_without_counts_have_no_occurrence_figure(sampled, exact):
    whole = {str(name): np.nan for name in exact if "mode" in exact[name].dims}
    plain = exact.drop_vars(whole).assign(probability=("mode", np.zeros(18)))
    assert shown(drawn=plain.assign_attrs(of="unstable"), certain=plain) == {}
