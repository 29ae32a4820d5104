"""Sensitivities of an onset against closed forms and differences of onsets solved for in 150 digits."""

import flint
import numpy as np
import pytest
import xarray as xr
from exact_ring import exact_values, ring_matrices
from flint import acb, acb_mat, arb, arb_mat
from helpers import pencils
from scipy.optimize import brentq

import hipuq
from hipuq import onset_sensitivity
from hipuq.cea.sensitivity import Derivatives
from hipuq.cea.sensitivity import onset_sensitivity as kernel
from hipuq.errors import InputError

# The certified first onsets and one later on, and an end of instability: preset, oscillator left
# out, friction, frequency.
BOUNDARIES = [
    ("oberst2016", None, 0.00949727246941, 2171.40307738),
    ("oberst2016", None, 0.0171403736059, 2166.60506015),
    ("oberst2016-calibrated", None, 0.0530121718119, 2323.95882211),
    ("oberst2016", 2, 0.00954848414102, 2171.38509811),
    ("oberst2016", 2, 0.0161705851156, 2169.56336129),
]

# Springs, contacts, angles and masses in the interior and at the left end, where the ring moves most.
ELEMENTS = {
    "spring_stiffness": (1, 5),
    "contact_stiffness": (0, 4),
    "spring_angle": (6,),
    "contact_angle": (3,),
    "friction_angle": (3,),
    "mass": (0, 4),
}

PRECISION = 500
"""Bits; differences are taken over 1e-20, so that they are exact to 30 digits and more."""


def hulten(w1, w2, e1, e2):
    """Return the closed-form onset squared and the frequency of the damped model of Hulten."""
    a, b, p, q = e1 * w1, e2 * w2, w1**2, w2**2
    rest = a * q + b * p
    squared = ((a + b) * (p + q + a * b) * rest - rest**2) / ((a + b) ** 2 * p * q) - 1
    return squared, rest / (a + b)


def difference(function, values, name, element=None):
    """Return the derivative of a function of named arb values, by a central difference of 1e-20."""
    value = values[name] if element is None else values[name][element]
    step = arb(10) ** -20 * (value if value != 0 else 1)
    sides = []
    for moved in (value + step, value - step):
        other = dict(values)
        if element is None:
            other[name] = moved
        else:
            other[name] = [moved if k == element else v for k, v in enumerate(values[name])]
        sides.append(function(other))
    return float(((sides[0] - sides[1]) / (2 * step)).mid())


def newton(function, start):
    """Solve two equations in two unknowns."""
    step = arb(10) ** -45
    x, y = start
    for _ in range(12):
        f, g = function(x, y)
        (fx, gx), (fy, gy) = function(x + step, y), function(x, y + step)
        matrix = arb_mat([[fx - f, fy - f], [gx - g, gy - g]]) * (1 / step)
        change = matrix.solve(arb_mat([[-f], [-g]]))
        x, y = (x + change[0, 0]).mid(), (y + change[1, 0]).mid()
        if abs(change[0, 0]) < arb(10) ** -60:
            return x, y
    raise AssertionError("no boundary found")


def double_root(v, friction, frequency):
    """Return the friction at which the characteristic polynomial has a double root, and that root."""
    constant, slope, _ = ring_matrices(v)

    def equations(mu, w):
        p = (constant + slope * mu).charpoly()
        return p(w), p.derivative()(w)

    return newton(equations, (arb(friction), (2 * arb.pi() * frequency / 1000) ** 2))


def crossing(v, friction, frequency):
    """Return the friction at which det(K - omega^2 M + i omega C) is zero, and omega."""
    constant, slope, damping = ring_matrices(v)

    def equations(mu, omega):
        matrix = acb_mat(constant + slope * mu) + acb_mat(damping) * acb(0, omega)
        for i in range(matrix.nrows()):
            matrix[i, i] -= omega * omega
        value = matrix.det()
        return value.real, value.imag

    return newton(equations, (arb(friction), 2 * arb.pi() * frequency / 1000))


def assert_as_differences(found, onset, values, elements, tolerance):
    """Compare derivatives with differences; relative to the largest of the parameter's elements."""
    for name, numbers in elements.items():
        scale = float(abs(found[name]).max())
        for k in numbers:
            expected = difference(onset, values, name, k)
            value = float(found[name] if k is None else found[name][k])
            assert value == pytest.approx(expected, abs=tolerance * scale, rel=0), (name, k)


def test_closed_form_of_hoffmann():
    model = hipuq.models.two_dof("hoffmann2002")
    found = onset_sensitivity(model, friction=0.47237749, frequency=np.sqrt(21) / (2 * np.pi))

    def onset(v):
        k11 = k12 = k22 = arb(0)
        for k, angle in ((v["k1"], v["angle_1"]), (v["k2"], v["angle_2"])):
            c, s = (angle / 180).cos_pi(), (angle / 180).sin_pi()
            k11, k12, k22 = k11 + k * c * c, k12 + k * c * s, k22 + k * s * s
        return (k12 * k12 + (k11 - k22 - v["k3"]) ** 2 / 4) / (k12 * v["k3"])

    with flint.ctx.workprec(PRECISION):
        values = exact_values(model)
        expected = {name: difference(onset, values, name) for name in found}
    assert set(found) == {"k1", "k2", "k3", "angle_1", "angle_2"}
    for name, value in expected.items():
        assert float(found[name]) == pytest.approx(value, rel=1e-10), name


@pytest.mark.parametrize("ratios", [(0.02, 0.02), (0.02, 0.06), (0.06, 0.02)])
def test_closed_form_of_hulten_with_damping(ratios):
    model = hipuq.models.two_dof("hulten", damping_1=ratios[0], damping_2=ratios[1])

    def onset(v):
        w = [2 * arb.pi() * v[f"frequency_{k}"] for k in (1, 2)]
        return hulten(*w, v["damping_1"], v["damping_2"])[0].sqrt()

    with flint.ctx.workprec(PRECISION):
        values = exact_values(model)
        expected = {name: difference(onset, values, name) for name in values if name != "friction"}
        friction = float(onset(values))
    omega = np.sqrt(hulten(200 * np.pi, 150 * np.pi, *ratios)[1])
    found = onset_sensitivity(model, friction=friction * (1 + 1e-5), frequency=omega / (2 * np.pi))
    for name, value in expected.items():
        assert float(found[name]) == pytest.approx(value, rel=1e-11), name


def test_closed_form_of_hulten_without_damping():
    model = hipuq.models.two_dof("hulten")
    found = onset_sensitivity(model, friction=7 / 24, frequency=np.sqrt((100**2 + 75**2) / 2))
    # mu = (r - 1 / r) / 2 with r the ratio of the frequencies.
    slope = (1 + (3 / 4) ** 2) / 2
    assert float(found["frequency_1"]) == pytest.approx(slope / 75, rel=1e-12)
    assert float(found["frequency_2"]) == pytest.approx(-slope * 100 / 75**2, rel=1e-12)
    for name in ("damping_1", "damping_2"):
        assert np.isnan(found[name])
        assert "jump" in found[name].attrs["comment"]


def test_growth_threshold_without_damping():
    """At l = g + i omega: mu^2 p q = (p - q)^2 / 4 + 4 g^2 (g^2 + (p + q) / 2)."""
    g = 20.0
    model = hipuq.models.two_dof("hulten", growth_threshold=g)

    def onset(v):
        p, q = ((2 * arb.pi() * v[f"frequency_{k}"]) ** 2 for k in (1, 2))
        inside = (p - q) ** 2 / 4 + 4 * v["g"] ** 2 * (v["g"] ** 2 + (p + q) / 2)
        return (inside / (p * q)).sqrt()

    with flint.ctx.workprec(PRECISION):
        values = exact_values(model, g=g)
        friction = float(onset(values))
        expected = {name: difference(onset, values, name) for name in ("frequency_1", "frequency_2", "g")}
    p, q = (200 * np.pi) ** 2, (150 * np.pi) ** 2
    found = onset_sensitivity(model, friction=friction, frequency=np.sqrt(g**2 + (p + q) / 2) / (2 * np.pi))
    for name in ("frequency_1", "frequency_2"):
        assert float(found[name]) == pytest.approx(expected[name], rel=1e-11)
    # C = c times unity takes c / 2 from every growth rate, to first order in c.
    both = float(found["damping_1"]) / p**0.5 + float(found["damping_2"]) / q**0.5
    assert both == pytest.approx(expected["g"] / 2, rel=1e-9)


def test_closed_form_of_divergence():
    """K = [[k1, -mu], [-mu, k2]] + m g^2: singular at mu^2 = (k1 + g^2 m) (k2 + g^2 m + g c)."""
    k1, k2, m, c, g = 3.0, 5.0, np.diag([0.7, 0.7]), np.diag([0.0, 0.4]), 0.8
    derivatives = Derivatives(
        mass=np.stack([0 * m, np.eye(2), 0 * m]),
        stiffness=np.stack([np.diag([1.0, 0.0]), 0 * m, 0 * m]),
        friction_stiffness=np.zeros((3, 2, 2)),
        damping=np.stack([0 * m, 0 * m, np.diag([0.0, 1.0])]),
    )
    sample = pencils(np.diag([k1, k2]), mass=m, friction_stiffness=[[0, -1], [-1, 0]], damping=c)
    first, second = k1 + g**2 * 0.7, k2 + g**2 * 0.7 + g * 0.4
    mu = np.sqrt(first * second)
    found = kernel(sample, mu * 1.0001, 0.0, derivatives, growth_threshold=g)
    expected = np.array([second, g**2 * (first + second), g * first]) / (2 * mu)
    assert found == pytest.approx(expected, rel=1e-13)
    static = kernel(sample, np.sqrt(k1 * k2), 0.0, derivatives)
    assert static == pytest.approx([np.sqrt(k2 / k1) / 2, 0.0, 0.0], rel=1e-13)


@pytest.mark.parametrize(("preset", "out", "friction", "frequency"), BOUNDARIES)
def test_ring_without_damping(preset, out, friction, frequency):
    """Every kind of parameter, relative to the largest of its elements: 4e-11 and better."""
    model = hipuq.models.ring(preset)
    contact = np.arange(1, 10) != out
    found = onset_sensitivity(model, model.nominal(contact=contact), friction=friction, frequency=frequency)
    with flint.ctx.workprec(PRECISION):
        values = exact_values(model, contact=contact)
        mu, w = double_root(values, friction, frequency)
        assert float(mu) == pytest.approx(friction, rel=2e-12)
        frequency = w.sqrt() * 1000 / (2 * arb.pi())

        def onset(v):
            return double_root(v, mu, frequency)[0]

        assert_as_differences(found, onset, values, ELEMENTS, 1e-10)
    for name in ("contact_stiffness", "contact_angle", "friction_angle"):
        assert (found[name].values[~contact] == 0).all()


@pytest.mark.parametrize(
    ("preset", "damping", "friction", "frequency"),
    [
        ("oberst2016", {"damping_ratio": 0.005}, 0.0356750323866, 2167.07976928),
        ("oberst2016", {"damping_ratio": 1e-4}, 0.0106578779407, 2170.96248814),
        ("oberst2016", {"mass_damping": 100.0, "stiffness_damping": 3e-7}, 0.0396511896258, 2167.24934009),
    ],
)
def test_ring_with_damping(preset, damping, friction, frequency):
    """Damping parameters that are zero too; near a coalescence, with little damping, 1e-10 and better."""
    model = hipuq.models.ring(preset, **damping)
    found = onset_sensitivity(model, friction=friction, frequency=frequency)
    elements = {name: numbers[-1:] for name, numbers in ELEMENTS.items()}
    elements |= {name: (None,) for name in ("damping_ratio", "mass_damping", "stiffness_damping")}
    with flint.ctx.workprec(PRECISION):
        values = exact_values(model)
        mu, omega = crossing(values, friction, frequency)
        frequency = omega * 1000 / (2 * arb.pi())

        def onset(v):
            return crossing(v, mu, frequency)[0]

        assert_as_differences(found, onset, values, elements, 1e-9)


def test_ring_with_damping_against_the_growth_rates_of_lapack():
    """Crossings found by bisection of computed growth rates, parameters moved by hand: 7 digits."""
    nominal = {"friction_angle": hipuq.models.ring().parameters["friction_angle"].nominal}
    model = hipuq.models.ring("oberst2016", damping_ratio=0.005, **nominal)

    def crossed(**changes):
        def growth(mu):
            outcome = model(model.nominal(friction=mu, **changes), keep=["growth_rate"])
            return float(outcome["growth_rate"].max())

        return brentq(growth, 0.03562, 0.03573, xtol=1e-14)

    friction = crossed()
    modes = model(model.nominal(friction=friction), keep=["growth_rate", "frequency"])
    frequency = float(modes["frequency"][0, modes["growth_rate"].values[0].argmax()])
    found = onset_sensitivity(model, friction=friction, frequency=frequency)
    for name, element, step in (
        ("spring_stiffness", 4, 1e5),
        ("contact_angle", 4, 1e-3),
        ("damping_ratio", (), 5e-6),
    ):
        sides = []
        for sign in (1, -1):
            value = np.array(model.parameters[name].nominal)
            value[element] += sign * step
            sides.append(crossed(**{name: value}))
        assert (sides[0] - sides[1]) / (2 * step) == pytest.approx(float(found[name][element]), rel=2e-6)


@pytest.mark.parametrize(("preset", "out", "friction", "frequency"), BOUNDARIES)
def test_units_of_force_and_mass_change_no_onset(preset, out, friction, frequency):
    """All stiffnesses together, and all masses together, do not move it."""
    model = hipuq.models.ring(preset)
    sample = model.nominal(contact=np.arange(1, 10) != out)
    found = onset_sensitivity(model, sample, friction=friction, frequency=frequency)
    scaled = {name: found[name].values * model.parameters[name].nominal for name in found}
    stiffness = np.concatenate([scaled["spring_stiffness"], scaled["contact_stiffness"]])
    for part in (stiffness, scaled["mass"]):
        assert abs(part.sum()) < 1e-9 * abs(part).max()


def test_turning_the_ring_changes_no_onset():
    model = hipuq.models.ring("oberst2016")
    _, _, friction, frequency = BOUNDARIES[0]
    found = onset_sensitivity(model, friction=friction, frequency=frequency)
    turned = [found[f"{name}_angle"].values for name in ("spring", "contact", "friction")]
    parts = np.concatenate(turned)
    assert abs(parts.sum()) < 1e-9 * abs(parts).max()


def test_a_friction_angle_that_follows_adds_up():
    """The sample's contact angle takes the friction angle with it; the derivatives are apart."""
    model = hipuq.models.ring("oberst2016")
    angle = model.parameters["contact_angle"].nominal.copy()
    angle[3] += 0.01
    sample = model.nominal(contact_angle=angle)
    explicit = model.nominal(contact_angle=angle, friction_angle=angle + 90)
    _, _, friction, frequency = BOUNDARIES[1]
    one, other = (
        onset_sensitivity(model, s, friction=friction, frequency=frequency) for s in (sample, explicit)
    )
    xr.testing.assert_identical(one.drop_attrs(), other.drop_attrs())


def test_the_dataset_is_labelled():
    model = hipuq.models.ring("oberst2016")
    _, _, friction, frequency = BOUNDARIES[0]
    sample = model.nominal(friction=0.3)
    before = sample.copy(deep=True)
    found = onset_sensitivity(model, sample, friction=friction, frequency=frequency)
    xr.testing.assert_identical(sample, before)
    assert set(found) == set(model.parameters) - {"friction", "contact"}
    assert found["spring_stiffness"].dims == ("spring",)
    assert found["mass"].dims == ("oscillator",)
    assert found["damping_ratio"].dims == ()
    assert found["mass"].attrs["units"] == "1/kg"
    assert found["spring_stiffness"].attrs["units"] == "1/(N/m)"
    assert found["damping_ratio"].attrs["units"] == "1"
    assert all(v.attrs["long_name"] and v.attrs["units"] for v in found.variables.values())
    assert found.attrs["model"] == model.label


def test_what_is_no_boundary_is_named():
    model = hipuq.models.ring("oberst2016")
    _, _, friction, frequency = BOUNDARIES[0]
    for wrong in ({"friction": friction * 1.01}, {"frequency": frequency * 1.01}, {"frequency": 330.0}):
        with pytest.raises(InputError, match="no boundary"):
            onset_sensitivity(model, **({"friction": friction, "frequency": frequency} | wrong))
    for wrong, message in (
        ({"friction": np.nan}, "friction is nan"),
        ({"friction": 0.0}, "friction is 0.0"),
        ({"frequency": -1.0}, "frequency is -1.0"),
    ):
        with pytest.raises(InputError, match=message):
            onset_sensitivity(model, **({"friction": friction, "frequency": frequency} | wrong))
    with pytest.raises(InputError, match="exactly one sample"):
        onset_sensitivity(model, model.nominal(friction=[0.1, 0.2]), friction=friction, frequency=frequency)
    six = model.nominal(contact=np.arange(9) < 6)
    with pytest.raises(InputError, match="mechanisms"):
        onset_sensitivity(model, six, friction=0.1, frequency=0.0)
