"""Inputs: variations of nominal values, columns of the unit cube, JSON round trip, errors."""

import chaospy as cp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

import hipuq
from hipuq.errors import InputError, UnknownNameError
from hipuq.inputs import Inputs

RING = hipuq.models.ring()
U = np.random.default_rng(1).random((50, 40))


def samples_of(inputs: Inputs):
    return inputs.samples(U[:, : inputs.dimension])


def test_relative_and_shift_vary_the_nominal_value():
    """Nominal times (1 + draw), nominal plus draw; with each one draw for each element."""
    inputs = RING.inputs(
        mass=hipuq.relative(cp.Uniform(-0.1, 0.1), each="oscillator"),
        spring_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1)),
        contact_angle=hipuq.shift(cp.Normal(0.0, 0.5), each="oscillator"),
        spring_angle=hipuq.shift(stats.uniform(-1, 2)),
    )
    assert inputs.dimension == 9 + 1 + 9 + 1
    assert inputs.groups == ["mass"] * 9 + ["spring_stiffness"] + ["contact_angle"] * 9 + ["spring_angle"]
    samples = samples_of(inputs)
    nominal = {name: RING.parameters[name].nominal for name in inputs}
    assert samples["mass"].values == pytest.approx(nominal["mass"] * (0.9 + 0.2 * U[:, :9]))
    shared = 0.9 + 0.2 * U[:, 9:10]
    assert samples["spring_stiffness"].values == pytest.approx(nominal["spring_stiffness"] * shared)
    shifts = stats.norm(0, 0.5).ppf(U[:, 10:19])
    assert samples["contact_angle"].values == pytest.approx(nominal["contact_angle"] + shifts, rel=1e-6)
    shared = nominal["spring_angle"] - 1 + 2 * U[:, 19:20]
    assert samples["spring_angle"].values == pytest.approx(shared)
    assert samples["mass"].dims == ("sample", "oscillator")
    assert samples["spring_angle"].dims == ("sample", "spring")
    assert samples["spring"].values.tolist() == list(range(1, 11))


def test_plain_distributions_give_the_values_themselves():
    inputs = RING.inputs(friction=cp.Uniform(0.0, 0.1), mass=cp.Uniform(20.0, 30.0))
    samples = samples_of(inputs)
    assert samples["friction"].values == pytest.approx(0.1 * U[:, 0])
    # One draw is shared by all elements.
    assert samples["mass"].values == pytest.approx(np.repeat(20 + 10 * U[:, 1:2], 9, axis=1))


def test_another_nominal_value_can_be_given():
    inputs = RING.inputs(mass=hipuq.relative(cp.Uniform(-0.1, 0.1), each="oscillator", nominal=10.0))
    assert samples_of(inputs)["mass"].values == pytest.approx(10 * (0.9 + 0.2 * U[:, :9]))
    plain = hipuq.Inputs(
        a=hipuq.shift(cp.Uniform(0, 1), nominal=5.0),
        b=hipuq.relative(cp.Uniform(0, 1), nominal=[1.0, 2.0], each="part"),
    )
    samples = samples_of(plain)
    assert samples["a"].values == pytest.approx(5 + U[:, 0])
    assert samples["b"].dims == ("sample", "part")
    assert samples["b"].values == pytest.approx((1 + U[:, 1:3]) * [1.0, 2.0])


def test_contact_patterns_are_one_discrete_input():
    patterns = hipuq.ContactPatterns((8, 9))
    inputs = RING.inputs(contact=patterns, friction=cp.Uniform(0, 0.1))
    assert inputs.dimension == 2
    assert inputs.discrete == ["contact"]
    samples = samples_of(inputs)
    assert np.array_equal(samples["contact"], patterns.patterns(patterns.ppf(U[:, 0])))
    assert samples["contact"].dtype == bool
    assert np.array_equal(samples["in_contact"], samples["contact"].sum("oscillator"))
    assert inputs.levels("contact").identical(patterns.levels())
    assert list(inputs.without("contact")) == ["friction"]


distributions = st.sampled_from(
    [
        cp.Uniform(-0.1, 0.3),
        cp.Normal(0.0, 0.01),
        cp.Beta(2, 3, -0.1, 0.1),
        stats.norm(0.1, 0.2),
        cp.Gamma(2.0),
    ]
)


@st.composite
def ring_inputs(draw) -> Inputs:
    """Return inputs of the ring: some of its parameters, each in one of the ways there are."""
    names = st.lists(
        st.sampled_from(["friction", "mass", "spring_stiffness", "contact_angle", "contact"]),
        min_size=1,
        unique=True,
    )
    chosen = {}
    for name in draw(names):
        distribution = draw(distributions)
        dims = {"friction": None, "spring_stiffness": "spring"}.get(name, "oscillator")
        each = draw(st.sampled_from([None, dims]))
        how = draw(st.sampled_from(["plain", "relative", "shift"]))
        if name == "contact":
            chosen[name] = hipuq.ContactPatterns(draw(st.sampled_from([9, (8, 9), (6, 7)])))
        elif how == "plain":
            chosen[name] = distribution
        else:
            chosen[name] = getattr(hipuq, how)(distribution, each=each)
    return RING.inputs(**chosen)


@given(ring_inputs())
def test_json_round_trip(inputs):
    """Rebuilt inputs are equal and give the same samples to the last bit."""
    again = Inputs.from_json(inputs.to_json())
    assert again == inputs
    assert again.groups == inputs.groups
    assert samples_of(again).identical(samples_of(inputs))


@given(ring_inputs())
def test_samples_are_valid_for_the_model(inputs):
    """Finite, labelled, over sample and the element dim that the model asks for."""
    samples = samples_of(inputs)
    assert set(samples.data_vars) == set(inputs)
    for name, values in samples.data_vars.items():
        assert values.dims[1:] == (() if name == "friction" else values.dims[1:2])
        assert np.isfinite(values.values.astype(float)).all()
        assert values.attrs["long_name"] and values.attrs["units"]


def test_the_ends_of_the_unit_interval_are_finite():
    """A design can touch 0, where a normal quantile is infinite."""
    inputs = hipuq.Inputs(x=cp.Normal(0, 1), y=stats.norm(0, 1), z=cp.Exponential(1.0))
    for end in (0.0, 1.0):
        samples = inputs.samples(np.full((1, 3), end))
        assert all(np.isfinite(samples[name].values).all() for name in inputs)


def test_inputs_are_a_frozen_mapping():
    inputs = hipuq.Inputs(x=cp.Uniform(0, 1), y=cp.Uniform(0, 2))
    assert list(inputs) == ["x", "y"] and len(inputs) == 2 and "x" in inputs
    assert inputs == hipuq.Inputs(x=cp.Uniform(0, 1), y=cp.Uniform(0, 2))
    assert inputs != hipuq.Inputs(x=cp.Uniform(0, 1), y=cp.Uniform(0, 3))
    with pytest.raises(TypeError):
        inputs["x"] = cp.Uniform(0, 1)
    assert "x: absolute" in repr(inputs)


def test_bad_inputs_are_named():
    uniform = cp.Uniform(0, 1)
    contact = hipuq.ContactPatterns(5, oscillators=6)
    cases = [
        (InputError, "there are no inputs", lambda: hipuq.Inputs()),
        (InputError, "x is 3.0: it must be a chaospy", lambda: hipuq.Inputs(x=3.0)),
        (InputError, "nobody knows: give nominal=", lambda: hipuq.Inputs(x=hipuq.relative(uniform))),
        (UnknownNameError, "did you mean 'friction'", lambda: RING.inputs(frictions=uniform)),
        (
            InputError,
            "allowed is each='oscillator'",
            lambda: RING.inputs(mass=hipuq.shift(uniform, each="spring")),
        ),
        (InputError, "allowed is no each", lambda: RING.inputs(friction=hipuq.shift(uniform, each="x"))),
        (
            InputError,
            r"nominal of mass has the shape \(2,\)",
            lambda: RING.inputs(mass=hipuq.shift(uniform, nominal=[1, 2])),
        ),
        (
            InputError,
            "nominal of x is nan",
            lambda: hipuq.Inputs(x=hipuq.shift(uniform, nominal=np.nan)),
        ),
        (
            InputError,
            "name that of its elements with each=",
            lambda: hipuq.Inputs(x=hipuq.shift(uniform, nominal=[1, 2])),
        ),
        (InputError, "give ContactPatterns", lambda: RING.inputs(contact=contact)),
        (InputError, "mass cannot be a contact pattern", lambda: RING.inputs(mass=contact)),
        (UnknownNameError, "unknown input 'y'", lambda: hipuq.Inputs(x=uniform)["y"]),
        (InputError, "has no levels", lambda: hipuq.Inputs(x=uniform).levels("x")),
        (InputError, "they need 1 columns", lambda: hipuq.Inputs(x=uniform).samples(np.zeros((2, 2)))),
        (InputError, "not a description of inputs", lambda: Inputs.from_json("{")),
        (InputError, "not a description of inputs", lambda: Inputs.from_json('{"x": {}}')),
        (InputError, "not a description of inputs", lambda: Inputs.from_json("[1]")),
    ]
    for error, message, call in cases:
        with pytest.raises(error, match=message):
            call()


def test_inputs_that_cannot_be_rebuilt_say_so():
    class Own:
        def ppf(self, u):
            return np.asarray(u)

    text = hipuq.Inputs(x=Own()).to_json()
    with pytest.raises(InputError, match="cannot be rebuilt"):
        Inputs.from_json(text)


@pytest.mark.parametrize("name", ["sample", "weight", "pattern", "replicate", "in_contact", "oscillator"])
def test_names_that_designs_use_are_refused(name):
    with pytest.raises(InputError, match=f"cannot be called '{name}'"):
        hipuq.Inputs(**{name: cp.Uniform(0, 1)})


def test_inputs_that_do_not_go_together_are_refused():
    patterns = hipuq.ContactPatterns(in_contact=(8, 9))
    with pytest.raises(InputError, match="several contact patterns"):
        hipuq.Inputs(a=patterns, b=patterns)
    with pytest.raises(InputError, match="dim 'part'"):
        hipuq.Inputs(
            a=hipuq.relative(cp.Uniform(0, 1), each="part", nominal=[1.0, 2.0]),
            b=hipuq.relative(cp.Uniform(0, 1), each="part", nominal=[1.0, 2.0, 3.0]),
        )


def test_a_nominal_value_that_is_no_number_is_named():
    with pytest.raises(InputError, match="nominal of a is 'x'"):
        hipuq.Inputs(a=hipuq.relative(cp.Uniform(0, 1), nominal="x"))
