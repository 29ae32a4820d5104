"""A model made from matrices in every analysis: stores, processes, methods, sweeps, own parameters."""

import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import chaospy as cp
import numpy as np
import pytest
from test_matrices import CONTACT, NONE, SPRINGS, hoffmann, random_matrices

import hipuq
from hipuq import schema
from hipuq.errors import InputError, StoreError
from hipuq.models import Parameter, from_matrices
from hipuq.models.matrices import MatrixModel


def test_another_matrix_is_another_model(tmp_path):
    """A store is gone on with for the same matrices, and refused for others, which are named."""
    samples = hoffmann().nominal(friction=np.linspace(0.0, 1.0, 9))
    store = tmp_path / "outcomes.zarr"
    first = hipuq.evaluate(hoffmann(), samples, store=store, progress=False)
    assert hipuq.evaluate(hoffmann(), samples, store=store, resume=True, progress=False).equals(first)
    other = CONTACT | {"stiffness": [[0, 0], [0, 11.000001]]}
    model = from_matrices([1, 1], SPRINGS, NONE, parts={"contact_factor": other})
    with pytest.raises(StoreError, match=r"matrices\.contact_factor\.stiffness"):
        hipuq.evaluate(model, samples, store=store, resume=True, progress=False)


def test_processes():
    model = pickle.loads(pickle.dumps(hoffmann()))
    assert model.options == hoffmann().options
    samples = model.nominal(friction=np.linspace(0.0, 1.0, 9))
    here = hipuq.evaluate(hoffmann(), samples, progress=False)
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        assert hipuq.evaluate(model, samples, executor=pool, progress=False).equals(here)


@pytest.mark.parametrize("method", ["monte_carlo", "chaos", "sobol"])
def test_methods_take_own_names_of_parameters(method, tmp_path):
    model = hoffmann()
    inputs = model.inputs(friction=cp.Uniform(0.0, 0.8), contact_factor=hipuq.relative(cp.Normal(0.0, 0.05)))
    results = hipuq.run(model, inputs, method=method, n=64, of="margin", rng=1)
    assert int(results["failed"]) == int(results["undecided"]) == 0
    hipuq.save_results(results, tmp_path / "results.nc")
    assert hipuq.load_results(tmp_path / "results.nc").to_dataset().equals(results)
    exact = hipuq.integrate_friction(model, cp.Uniform(0.0, 0.8))
    results = hipuq.run(exact, inputs.without("friction"), method=method, n=64, of="probability", rng=1)
    assert int(results["failed"]) == 0


def test_sweep_and_figures():
    from matplotlib import pyplot as plt

    model = hoffmann()
    swept = hipuq.sweep(
        model,
        model.inputs(friction=cp.Uniform(0.0, 0.8)),
        over={"contact_factor": [0.9, 1.0, 1.1], "damping_ratio": [0.0, 0.01]},
        method="monte_carlo",
        n=64,
        of="any_unstable",
        rng=1,
    )
    assert swept["probability"].dims == ("contact_factor", "damping_ratio")
    axes = hipuq.plots.probability_over(swept.isel(damping_ratio=0), dim="contact_factor")
    assert "contact_factor" in axes.get_xlabel()
    inputs = model.inputs(friction=cp.Uniform(0.0, 0.8), contact_factor=cp.Uniform(0.9, 1.1))
    axes = hipuq.plots.index_bars(hipuq.run(model, inputs, method="sobol", n=64, of="margin", rng=1))
    assert "contact_factor" in [label.get_text() for label in axes.get_xticklabels() + axes.get_yticklabels()]
    plt.close("all")


def test_own_parameters_of_a_subclass():
    """Names and units of a model's own, in degrees: labelled, checked, and with derivatives."""

    class Inclined(type(hoffmann())):
        name = "inclined"

        def assemble(self, values):
            angle = np.radians(values["pad_angle"])
            return super().assemble(values | {"contact_factor": np.cos(angle) ** 2})

    base = hoffmann()
    angle = Parameter(np.array(10.0), 0.0, variable=schema.Variable("angle of the pad", "deg"))
    model = Inclined(base.base, base.parts, base.parameters | {"pad_angle": angle}, 0, preset="inclined")
    assert model.nominal(pad_angle=20.0)["pad_angle"].attrs["units"] == "deg"
    inputs = model.inputs(
        pad_angle=cp.Uniform(5.0, 15.0), contact_factor=hipuq.relative(cp.Uniform(0.0, 0.1))
    )
    for same in (inputs, hipuq.Inputs.from_json(inputs.to_json())):
        assert same == inputs
        samples = hipuq.design("monte_carlo", same, n=4, rng=1)
        assert samples["pad_angle"].attrs == {"long_name": "angle of the pad", "units": "deg"}
        assert samples["contact_factor"].attrs["units"] == "1"
    broken = inputs.to_json().replace('"deg"', "3")
    with pytest.raises(InputError, match="labels of pad_angle"):
        hipuq.Inputs.from_json(broken)
    with pytest.raises(InputError, match="not below 0 deg"):
        model(model.nominal(pad_angle=-1.0))
    factor = np.cos(np.radians(10.0)) ** 2
    found = hipuq.unstable_friction(base, base.nominal(contact_factor=factor), upper=1.0)
    place = {name: found[name].item() for name in ("friction", "frequency")}
    slope = hipuq.onset_sensitivity(model, **place)["pad_angle"]
    by_angle = -np.radians(1) * np.sin(np.radians(20.0))
    by_factor = hipuq.onset_sensitivity(base, base.nominal(contact_factor=factor), **place)["contact_factor"]
    assert slope.item() == pytest.approx(by_angle * by_factor.item(), rel=1e-8)
    assert slope.attrs["units"] == "1/deg"
    unnamed = base.parameters | {"pad_angle": Parameter(np.array(10.0))}
    with pytest.raises(InputError, match="schema does not know the parameter 'pad_angle'"):
        Inclined(base.base, base.parts, unnamed, 0, preset="inclined")
    other = base.parameters | {"damping_1": angle}
    with pytest.raises(InputError, match=r"'damping_1' is the relative damping 1 .* take another name"):
        Inclined(base.base, base.parts, other, 0, preset="inclined")


def test_a_part_called_self():
    model = from_matrices([1, 1], SPRINGS, NONE, parts={"self": CONTACT})
    for one in (model, hipuq.integrate_friction(model, cp.Uniform(0.0, 0.8))):
        assert one.nominal(self=1.1)["self"].item() == 1.1
        assert one.inputs(self=cp.Uniform(0.9, 1.1)).dimension == 1


def test_a_study_is_no_model(tmp_path):
    with pytest.raises(InputError, match="study is MatrixModel"):
        hipuq.run_study(hoffmann(), tmp_path)


def with_parts(kind, size, damping, nominal=0.0):
    """Return a model with a full mass and a part of each kind, all of it of a size."""
    base, change = random_matrices(1, 5), random_matrices(2, 5)
    if not damping:
        for one in (base, change):
            del one["damping"]
    parts = {f"of_{name}": {name: size * one} for name, one in change.items()}
    given = {f"of_{name}": nominal / size for name in change}
    given |= {} if damping else {"damping_ratio": 0.02, "mass_damping": 0.01, "stiffness_damping": 0.001}
    return kind(from_matrices(**base, parts=parts, nominal=given))


@pytest.mark.parametrize("damping", [False, True])
@pytest.mark.parametrize("nominal", [0.0, 0.1])
def test_derivatives_are_exact_for_parts_of_any_size(damping, nominal):
    """Those of differences, which a subclass takes; and the same of a part 1e12 times smaller or larger."""

    class Differences(MatrixModel):
        def __init__(self, one):
            super().__init__(one.base, one.parts, one.parameters, 0, preset=one.preset)

    by_differences = with_parts(Differences, 1.0, damping, nominal)
    found = hipuq.unstable_friction(by_differences, upper=3.0)
    place = {name: found[name].values[0] for name in ("friction", "frequency")}
    theirs = hipuq.onset_sensitivity(by_differences, **place)
    for size in (1e-12, 1.0, 1e12):
        ours = hipuq.onset_sensitivity(with_parts(lambda one: one, size, damping, nominal), **place)
        assert set(ours) == set(theirs)
        for name in ours:
            scale = size if name.startswith("of_") else 1.0
            assert ours[name].item() / scale == pytest.approx(theirs[name].item(), rel=1e-8), (name, size)


def test_derivative_with_respect_to_a_ground_spring():
    """1 N/m beside 1e11 N/m, diagonal mass, undamped: the closed form of two degrees of freedom."""
    stiffness, friction = (
        1e11 * np.array([[3.0, 1.0], [1.0, 2.0]]),
        1e11 * np.array([[0.0, -1.0], [0.0, 0.0]]),
    )
    model = from_matrices(
        [1, 1], stiffness, friction, parts={"ground": {"stiffness": [[1, 0], [0, 0]]}}, nominal={"ground": 0}
    )
    # (k11 - k22)^2 / 4 + k12 (k12 - mu k) = 0, so d mu / d k11 = (k11 - k22) / (2 k12 k).
    found = hipuq.unstable_friction(model, upper=2.0)
    assert found["friction"].item() == pytest.approx(1.25, rel=1e-12)
    place = {name: found[name].item() for name in ("friction", "frequency")}
    slopes = hipuq.onset_sensitivity(model, **place)
    assert slopes["ground"].item() == pytest.approx(0.5e-11, rel=1e-12)
    assert np.isnan(slopes["damping_ratio"])
