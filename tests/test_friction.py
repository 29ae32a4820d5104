"""Friction integrated over its distribution: certified values, closed forms, dense sampling, refusals."""

import json

import chaospy as cp
import numpy as np
import published
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

import hipuq
from hipuq.cea.onset import boundaries
from hipuq.errors import InputError, UnknownNameError
from hipuq.friction_range import TAIL

HOFFMANN = hipuq.models.two_dof("hoffmann2002")
HULTEN = hipuq.models.two_dof("hulten")

SHIFT = 5e-12
"""Error that a density around 4 makes of the 1e-12 by which a boundary is moved to its stable side."""


def probability(model, distribution, **values) -> float:
    """Return the probability of one configuration, with nothing left unknown."""
    exact = hipuq.integrate_friction(model, distribution)
    outcomes = exact(exact.nominal(**values))
    assert outcomes["status"].item() == 0
    return outcomes["probability"].item()


class Atoms:
    """A distribution of single values."""

    def __init__(self, places, masses) -> None:
        self.places = np.array(places, dtype=float)
        self.cumulative = np.cumsum(masses)
        self.cumulative[-1] = 1.0

    def ppf(self, u):
        return self.places[np.searchsorted(self.cumulative, u, side="left")]

    def cdf(self, x):
        return np.concatenate([[0.0], self.cumulative])[np.searchsorted(self.places, x, side="right")]


class Mixture:
    """Film and boundary lubrication: two uniform regimes with nothing in between."""

    def cdf(self, x):
        return 0.75 * stats.uniform(0.0, 0.1).cdf(x) + 0.25 * stats.uniform(0.3, 0.5).cdf(x)

    def ppf(self, u):
        u = np.asarray(u, dtype=float)
        return np.where(u <= 0.75, 0.1 * u / 0.75, 0.3 + 0.5 * (u - 0.75) / 0.25)


@pytest.mark.parametrize("preset", published.PROBABILITY_ANY_UNSTABLE)
def test_certified_probabilities_of_8_and_9_contacts(preset):
    """Means to all printed digits, and the least and the most that leaving one oscillator out gives."""
    exact = hipuq.integrate_friction(hipuq.models.ring(preset), cp.Uniform(0.0, 0.1))
    patterns = hipuq.ContactPatterns(in_contact=(8, 9)).samples()
    found = hipuq.evaluate(exact, patterns)
    assert (found["status"] == 0).all()
    mean = found["probability"].groupby("in_contact").mean()
    for count, expected in published.PROBABILITY_ANY_UNSTABLE[preset].items():
        digits = len(str(expected)) - 2
        assert round(float(mean.sel(in_contact=count)), digits) == expected
    if preset == "oberst2016":
        # Patterns are in lexicographic order: the last oscillator is left out first.
        without = dict(zip(range(9, 0, -1), found["probability"].values[:9], strict=True))
        assert min(without, key=without.__getitem__) == 5
        assert max(without, key=without.__getitem__) in (2, 8)
        for number, expected in published.PROBABILITY_WITHOUT.items():
            assert without[number] == pytest.approx(expected, abs=1e-8)
        onset = dict(zip(range(9, 0, -1), found["onset"].values[:9], strict=True))
        # The reference has 8 digits.
        assert onset == pytest.approx(published.FIRST_ONSET_WITHOUT, rel=1e-7)


def test_closed_forms():
    uniform = cp.Uniform(0.0, 0.8)
    assert probability(HOFFMANN, uniform) == pytest.approx(published.HOFFMANN_PROBABILITY, abs=1e-10)
    assert probability(HOFFMANN, uniform) == pytest.approx(1 - published.HOFFMANN_ONSET / 0.8, abs=SHIFT)
    for (damping_1, damping_2), onset in published.HULTEN_ONSETS.items():
        found = probability(HULTEN, uniform, damping_1=damping_1, damping_2=damping_2)
        assert found == pytest.approx(1 - onset / 0.8, abs=1e-11)


def test_growth_below_the_threshold_is_no_instability():
    """Undamped, growth g needs a squared gap of -(2 g omega)^2 about: Hoffmann's is linear in friction."""
    threshold = 0.2
    model = hipuq.models.two_dof("hoffmann2002", growth_threshold=threshold)
    exact = hipuq.integrate_friction(model, cp.Uniform(0.0, 0.8))
    onset = exact(exact.nominal())["onset"].item()
    # l^2 = -w with l = g + i omega: w = omega^2 - g^2 -+ 2 i g omega, and Re w = 21 at every friction.
    omega = np.sqrt(21 + threshold**2)
    gap = -((4 * threshold * omega) ** 2)
    k11, k12, k22 = 23.25, -4.5 * np.sqrt(3) / 2, 18.75
    expected = published.HOFFMANN_ONSET - gap / (4 * abs(k12) * 11)
    assert onset == pytest.approx(expected, rel=1e-12)
    assert (k11 - k22) ** 2 + 4 * k12 * (k12 + 11 * onset) == pytest.approx(gap, rel=1e-10)
    beside = model(model.nominal(friction=onset * np.array([1 - 1e-9, 1 + 1e-9])))
    assert beside["any_unstable"].values.tolist() == [0, 1]


CONFIGURATIONS = {
    "9": {},
    "8": {"contact": [1, 0, 1, 1, 1, 1, 1, 1, 1]},
    "7": {"contact": [1, 1, 0, 1, 1, 0, 1, 1, 1]},
    "6": {"contact": [0, 1, 1, 0, 1, 1, 0, 1, 1]},
    "scattered": {
        "spring_stiffness": 1.05e9 * (1 + 0.1 * np.cos(np.arange(10) ** 2)),
        "contact_stiffness": 4.2e9 * (1 + 0.1 * np.sin(np.arange(9) ** 2)),
    },
    "damped": {"damping_ratio": 0.001},
    "damped, 7": {"damping_ratio": 0.0005, "contact": [1, 1, 1, 1, 0, 0, 1, 1, 1]},
}


@pytest.mark.parametrize("values", CONFIGURATIONS.values(), ids=CONFIGURATIONS)
@pytest.mark.parametrize("preset", published.ONSETS)
def test_dense_sampling_agrees(values, preset):
    """At the middles of 1,000 steps of friction: each end of an interval costs half a step at most."""
    model = hipuq.models.ring(preset)
    exact = hipuq.integrate_friction(model, cp.Uniform(0.0, 0.1))
    found = exact(exact.nominal(**values)).isel(sample=0)
    assert found["status"] == 0
    friction = 0.1 * (np.arange(1000) + 0.5) / 1000
    seen = model(model.nominal(friction=friction, **values), ["unstable", "any_unstable"])
    ends = found["interval"].values
    inside = ((friction[:, None] > ends[:, 0]) & (friction[:, None] < ends[:, 1])).any(axis=1)
    assert np.array_equal(inside, seen["any_unstable"] == 1)
    for name, verdict in (("probability", "any_unstable"), ("probability_by_mode", "unstable")):
        changes = np.abs(np.diff(seen[verdict].values, axis=0)).sum(axis=0)
        # Two boundaries may lie in one step.
        assert (np.abs(found[name] - seen[verdict].mean("sample")) <= (0.5 * changes + 1) / 1000).all()
    assert (found["probability_by_mode"] <= found["probability"] + 1e-15).all()
    assert found["probability_by_mode"].sum() >= found["probability"] - 1e-15


CONTINUOUS = [
    (cp.Uniform(0.2, 0.9), stats.uniform(0.2, 0.7)),
    (cp.Beta(2, 3, 0.1, 0.9), stats.beta(2, 3, 0.1, 0.8)),
    (cp.LogNormal(np.log(0.4), 0.3), stats.lognorm(0.3, scale=0.4)),
    (cp.Normal(0.4, 0.1), stats.norm(0.4, 0.1)),
    (cp.TruncNormal(0.0, 0.8, 0.4, 0.1), stats.truncnorm(-4, 4, 0.4, 0.1)),
]


@pytest.mark.parametrize("pair", CONTINUOUS, ids=lambda pair: type(pair[0]).__name__)
def test_the_probability_is_that_beyond_the_onset(pair):
    """One boundary, so the survival function there, whoever made the distribution."""
    expected = pair[1].sf(published.HOFFMANN_ONSET)
    for distribution in pair:
        exact = hipuq.integrate_friction(HOFFMANN, distribution)
        found = exact(exact.nominal()).isel(sample=0)
        assert found["probability_low"].item() <= expected + SHIFT
        assert found["probability_high"].item() >= expected - SHIFT
        assert found["probability"].item() == pytest.approx(expected, abs=1.1 * TAIL)


def test_a_tail_that_is_cut_off_goes_into_the_bounds():
    exact = hipuq.integrate_friction(HOFFMANN, stats.norm(0.4, 0.1))
    assert (exact.lower, exact.upper) == pytest.approx(stats.norm(0.4, 0.1).ppf([TAIL, 1 - TAIL]), rel=1e-12)
    found = exact(exact.nominal()).isel(sample=0)
    width = float(found["probability_high"] - found["probability_low"])
    assert width == pytest.approx(2 * TAIL, rel=1e-6)
    assert found["probability_low"] < found["probability"] < found["probability_high"]
    one_sided = hipuq.integrate_friction(HOFFMANN, stats.expon(scale=0.2))
    assert one_sided.lower == 0.0
    found = one_sided(one_sided.nominal()).isel(sample=0)
    assert float(found["probability_high"] - found["probability_low"]) == pytest.approx(TAIL, rel=1e-6)


def test_a_support_that_reaches_below_zero():
    """Negative friction turns the sense of sliding: Hulten's model does not feel it."""
    exact = hipuq.integrate_friction(HULTEN, cp.Uniform(-0.8, 0.8))
    found = exact(exact.nominal()).isel(sample=0)
    onset = published.HULTEN_ONSETS[0.0, 0.0]
    assert found["probability"].item() == pytest.approx(1 - onset / 0.8, abs=SHIFT)
    assert found["interval"].values == pytest.approx(np.array([[-0.8, -onset], [onset, 0.8]]), rel=1e-13)
    assert found["onset"] == -0.8


def test_discrete_distributions():
    assert probability(HOFFMANN, cp.DiscreteUniform(0, 3)) == 0.75
    assert probability(HOFFMANN, cp.Binomial(1, 0.25)) == pytest.approx(0.25, abs=1e-15)
    assert probability(HOFFMANN, stats.bernoulli(0.25)) == pytest.approx(0.25, abs=1e-15)


def test_atoms():
    """At the ends of the support and inside they count where they are; on a boundary as stable."""
    ((onset,),) = boundaries(HOFFMANN.pencils(HOFFMANN.nominal()), 0.0, 0.8)
    at = onset.friction
    cases = [
        ([0.0, 0.5, 0.8], 0.5),
        ([0.0, 0.2, 0.8], 0.25),
        ([0.0, at, 0.8], 0.25),
        ([0.0, at * (1 - 1e-13), 0.8], 0.25),
        ([0.0, at * (1 + 1e-11), 0.8], 0.5),
        ([at, 0.6, 0.8], 0.5),
        ([at * (1 + 1e-13), 0.6, 0.8], 0.5),
        ([at * (1 + 1e-11), 0.6, 0.8], 1.0),
        ([0.0, 0.1, at], 0.0),
        ([0.0, 0.1, at * (1 + 1e-13)], 0.0),
        ([0.0, 0.1, at * (1 + 1e-11)], 0.25),
    ]
    for places, expected in cases:
        found = probability(HOFFMANN, Atoms(places, [0.5, 0.25, 0.25]))
        assert found == pytest.approx(expected, abs=1e-15), places


def test_an_atom_where_instability_ends_is_stable():
    """Mirrored Hulten: unstable below -7/24, an atom right there at the upper end of the support."""
    ((end,),) = boundaries(HULTEN.pencils(HULTEN.nominal()), -0.8, 0.0)
    assert probability(HULTEN, Atoms([-0.8, end.friction], [0.5, 0.5])) == 0.5
    assert probability(HULTEN, Atoms([-0.8, end.friction, 0.0], [0.5, 0.25, 0.25])) == 0.5


def test_a_mixture():
    found = probability(HOFFMANN, Mixture())
    assert found == pytest.approx(0.25 * (0.8 - published.HOFFMANN_ONSET) / 0.5, abs=SHIFT)


def test_a_configuration_that_is_never_unstable():
    exact = hipuq.integrate_friction(HOFFMANN, cp.Uniform(0.0, 0.8))
    found = hipuq.evaluate(exact, exact.nominal(k3=np.array([11.0, 0.5])), progress=False)
    assert found["onset"].values[1] == np.inf
    assert found["interval_count"].values.tolist() == [1, 0]
    assert np.isnan(found["interval"].values[1]).all()
    for name in ("probability", "probability_low", "probability_high"):
        assert found[name].values[1] == 0
    assert (found["probability_by_mode"][1] == 0).all()
    never = exact(exact.nominal(k3=0.5))
    assert never["interval"].shape == (1, 0, 2)


def test_an_onset_that_is_infinite_has_no_mean():
    exact = hipuq.integrate_friction(HOFFMANN, cp.Uniform(0.0, 0.4))
    inputs = exact.inputs(k3=cp.Uniform(10.0, 20.0))
    with pytest.raises(InputError, match=r"onset is infinite in \d+ samples \(\d+\.\d+%\)"):
        hipuq.run(exact, inputs, method="monte_carlo", n=64, of="onset", rng=1, progress=False)


def test_friction_is_no_input_any_more():
    exact = hipuq.integrate_friction(HOFFMANN, cp.Uniform(0.0, 0.8))
    assert "friction" not in exact.parameters
    assert "friction" in HOFFMANN.parameters
    coordinate = exact.nominal(k1=10.0).assign_coords(friction=("sample", [0.1]))
    for call in (
        lambda: exact.inputs(friction=cp.Uniform(0, 1)),
        lambda: exact.nominal(friction=0.1),
        lambda: exact(HOFFMANN.nominal(friction=0.1)),
        lambda: exact(coordinate),
        lambda: hipuq.evaluate(exact, HOFFMANN.nominal(friction=[0.1, 0.2]), progress=False),
    ):
        with pytest.raises(InputError, match="friction is integrated over its distribution"):
            call()


def test_names_are_checked():
    exact = hipuq.integrate_friction(HOFFMANN, cp.Uniform(0.0, 0.8))
    with pytest.raises(UnknownNameError, match="did you mean 'angle_1'"):
        exact.inputs(angle1=cp.Uniform(0, 1))
    with pytest.raises(UnknownNameError, match="did you mean 'angle_1'"):
        exact.nominal(angle1=0.1)
    with pytest.raises(UnknownNameError, match="did you mean 'angle_1'"):
        hipuq.evaluate(exact, xr.Dataset({"angle1": ("sample", [1.0])}), progress=False)
    with pytest.raises(UnknownNameError, match="did you mean 'probability'"):
        exact(exact.nominal(), ["probabilty"])


def test_what_cannot_be_integrated_is_named():
    class WithoutCdf:
        def ppf(self, u):
            return np.asarray(u)

    uniform = cp.Uniform(0.0, 0.8)
    for model in (hipuq.integrate_friction(HOFFMANN, uniform), lambda samples: samples, "ring"):
        with pytest.raises(InputError, match="friction cannot be integrated"):
            hipuq.integrate_friction(model, uniform)
    with pytest.raises(InputError, match="has no cdf"):
        hipuq.integrate_friction(HOFFMANN, WithoutCdf())
    with pytest.raises(InputError, match="covers 1 to 1 of what can be swept"):
        hipuq.integrate_friction(HOFFMANN, cp.DiscreteUniform(1, 1))
    for value in (0.3, cp.J(cp.Uniform(), cp.Uniform()), hipuq.relative(cp.Uniform(0, 1))):
        with pytest.raises(InputError, match="distribution of friction is"):
            hipuq.integrate_friction(HOFFMANN, value)


def test_conditional_monte_carlo_is_the_sharper_one():
    """Scattered stiffness: both means within each other's intervals, and the variance falls."""
    model = hipuq.models.ring("oberst2016-calibrated", oscillators=4)
    friction = cp.Uniform(0.0, 1.0)
    exact = hipuq.integrate_friction(model, friction)
    scatter = {"contact_stiffness": hipuq.relative(cp.Uniform(-0.3, 0.3), each="oscillator")}
    options = {"method": "monte_carlo", "rng": 1, "progress": False}
    sharp = hipuq.run(exact, exact.inputs(**scatter), n=256, of="probability", **options)
    inputs = model.inputs(friction=friction, **scatter)
    plain = hipuq.run(model, inputs, n=4096, of="any_unstable", **options)
    assert sharp["probability_low"] < plain["probability_high"]
    assert plain["probability_low"] < sharp["probability_high"]
    widths = [float(one["probability_high"] - one["probability_low"]) for one in (sharp, plain)]
    assert widths[0] / np.sqrt(4096 / 256) < 0.5 * widths[1]


def scattered(exact, n: int) -> xr.Dataset:
    inputs = exact.inputs(
        contact=hipuq.ContactPatterns(in_contact=(3, 4, 5), oscillators=5),
        contact_stiffness=hipuq.relative(cp.Uniform(-0.3, 0.3), each="oscillator"),
    )
    return hipuq.design("monte_carlo", inputs, n, 2)


def test_same_bits_however_it_is_divided(monkeypatch):
    exact = hipuq.integrate_friction(hipuq.models.ring(oscillators=5), cp.Uniform(0.0, 0.6))
    samples = scattered(exact, 24)
    whole = hipuq.evaluate(exact, samples, n_jobs=1, progress=False)
    assert whole.sizes["interval"] > 1
    for block, jobs in ((7, 1), (5, 2), (24, 2)):
        monkeypatch.setattr(exact, "block", block, raising=False)
        assert hipuq.evaluate(exact, samples, n_jobs=jobs, progress=False).equals(whole)


def test_only_what_is_kept_comes_and_it_is_the_same():
    exact = hipuq.integrate_friction(hipuq.models.ring(oscillators=5), cp.Uniform(0.0, 0.6))
    samples = scattered(exact, 8)
    whole = hipuq.evaluate(exact, samples, progress=False)
    for name in hipuq.integrate_friction(HOFFMANN, cp.Uniform(0, 1)).outcomes:
        kept = hipuq.evaluate(exact, samples, keep=[name], progress=False)
        made = set(kept.variables) - set(samples.variables) - {"mode", "pair"}
        assert made == {name, "status", "decided_by"}
        assert kept[name].equals(whole[name])


@pytest.mark.parametrize("k3", [[11.0, 0.5], [0.5, 0.4]], ids=["some unstable", "none unstable"])
def test_outcomes_survive_the_disk(tmp_path, k3):
    """With the variable interval, which xarray takes for a coordinate, and also if there is no interval."""
    exact = hipuq.integrate_friction(HOFFMANN, cp.Uniform(0.0, 0.8))
    found = hipuq.evaluate(exact, exact.nominal(k3=np.array(k3)), progress=False)
    hipuq.save_outcomes(found, tmp_path / "outcomes.zarr")
    xr.testing.assert_identical(hipuq.load_outcomes(tmp_path / "outcomes.zarr").load(), found)


@pytest.mark.parametrize(
    "distribution", [cp.Normal(0.4, 0.1), stats.norm(0.4, 0.1), Mixture()], ids=["chaospy", "scipy", "own"]
)
def test_options_say_what_was_integrated(distribution):
    exact = hipuq.integrate_friction(HOFFMANN, distribution)
    options = json.loads(json.dumps(exact.options))
    integrated = options.pop("integrated")
    assert options == HOFFMANN.options
    assert set(integrated) == {"friction"}
    found = hipuq.evaluate(exact, exact.nominal(), progress=False)
    assert json.loads(found.attrs["options"])["model"]["integrated"] == integrated
    assert found.attrs["model"] == exact.label == "two_dof(hoffmann2002), friction integrated"


def test_every_outcome_is_labelled():
    exact = hipuq.integrate_friction(HOFFMANN, cp.Uniform(0.0, 0.8))
    found = exact(exact.nominal())
    assert set(exact.outcomes) == set(found.variables) - {"mode", "pair"}
    for name, values in found.variables.items():
        assert values.attrs["long_name"] and values.attrs["units"], name


@given(st.lists(st.floats(0.01, 1.5), min_size=2, max_size=6, unique=True))
def test_what_is_unstable_grows_with_the_range(ends):
    """P(U(0, a)) times a is the length of the unstable set below a: it never falls, and never faster
    than a rises."""
    a = np.sort(ends)
    length = [probability(HOFFMANN, cp.Uniform(0.0, one)) * one for one in a]
    assert (np.diff(length) >= -1e-14).all()
    assert (np.diff(length) <= np.diff(a) + 1e-14).all()


def test_what_is_unstable_grows_with_the_range_of_a_ring():
    contact = [0, 1, 1, 0, 1, 1, 0, 1, 1]
    model = hipuq.models.ring("oberst2016")
    upper = np.array([0.008, 0.011, 0.015, 0.02, 0.05, 0.1])
    length = np.array([probability(model, cp.Uniform(0.0, a), contact=contact) * a for a in upper])
    assert (np.diff(length) >= 0).all()
    assert (np.diff(length) <= np.diff(upper) + 1e-15).all()


@given(st.floats(0.3, 3.0), st.floats(0.05, 1.0), st.floats(-0.5, 0.5))
def test_bounds_hold_the_probability(sigma, scale, middle):
    """To the last bit, wherever the distribution lies."""
    for distribution in (stats.norm(middle, scale), stats.lognorm(sigma, scale=scale)):
        exact = hipuq.integrate_friction(HULTEN, distribution)
        found = exact(exact.nominal()).isel(sample=0)
        ends = [found[name].item() for name in ("probability_low", "probability", "probability_high")]
        assert 0.0 <= ends[0] <= ends[1] <= ends[2] <= 1.0
        onset = published.HULTEN_ONSETS[0.0, 0.0]
        expected = distribution.sf(onset) + distribution.cdf(-onset)
        assert ends[0] - SHIFT <= expected <= ends[2] + SHIFT


def test_a_boundary_next_to_the_end_of_the_range_leaves_nothing_negative():
    """Nearer to the cut tail than the distance at which boundaries are certified."""
    ((onset,),) = boundaries(HOFFMANN.pencils(HOFFMANN.nominal()), 0.0, 0.8)
    scale = (onset.friction * (1 + 1e-13) - 0.4) / stats.norm.ppf(1 - TAIL)
    exact = hipuq.integrate_friction(HOFFMANN, stats.norm(0.4, scale))
    found = exact(exact.nominal()).isel(sample=0)
    assert found["probability_low"] >= 0
    assert found["probability_by_mode"].min() >= 0


def changed(values: dict, **changes) -> dict:
    return {name: changes.get(name, lambda x: x)(value) for name, value in values.items()}


def test_symmetries_of_a_ring():
    """Units, turning everything, and a mirror, which turns the sense of sliding and so friction round."""
    rng = np.random.default_rng(3)
    values = {
        "contact": np.array([1, 1, 0, 1, 1]),
        "mass": 22.22 * rng.uniform(0.9, 1.1, 5),
        "spring_stiffness": 1.05e9 * rng.uniform(0.9, 1.1, 6),
        "contact_stiffness": 3.98e9 * rng.uniform(0.9, 1.1, 5),
        "spring_angle": 67.5 + 45 * np.arange(6),
        "contact_angle": 180 + 45.0 * np.arange(5),
    }
    values["friction_angle"] = values["contact_angle"] + 90
    model = hipuq.models.ring("oberst2016", oscillators=5)

    def found(lower, upper, **values):
        exact = hipuq.integrate_friction(model, cp.Uniform(lower, upper))
        return exact(exact.nominal(**values), ["probability", "probability_by_mode", "onset"]).isel(sample=0)

    reference = found(0.0, 0.9, **values)
    assert 0 < reference["probability"] < 1
    scaled = changed(values, spring_stiffness=lambda k: 4 * k, contact_stiffness=lambda k: 4 * k)
    assert found(0.0, 0.9, **scaled).equals(reference)
    turned = {name: value + 17.0 if name.endswith("angle") else value for name, value in values.items()}
    mirrored = {name: value[::-1] for name, value in values.items()}
    mirrored |= {name: 180 - mirrored[name] for name in ("spring_angle", "contact_angle")}
    mirrored["friction_angle"] = mirrored["contact_angle"] + 90
    for other in (found(0.0, 0.9, **turned), found(-0.9, 0.0, **mirrored)):
        for name in ("probability", "probability_by_mode"):
            assert other[name].values == pytest.approx(reference[name].values, abs=1e-9)


def test_without_an_input_of_its_own_a_mirror_is_no_symmetry():
    """Reflected contact with the same sense of sliding: another system, and another answer."""
    exact = hipuq.integrate_friction(hipuq.models.ring("oberst2016"), cp.Uniform(0.0, 0.1))
    contact = np.array([[0, 1, 1, 1, 1, 1, 1, 1, 1], [1, 1, 1, 1, 1, 1, 1, 1, 0]])
    left, right = exact(exact.nominal(contact=contact), ["probability"])["probability"].values
    assert abs(left - right) > 1e-6


def test_heavy_tails_and_discrete_supports():
    """What cannot be swept widens the bounds; a discrete distribution begins at its first value."""
    heavy = hipuq.integrate_friction(HOFFMANN, stats.levy(scale=0.1))
    found = hipuq.evaluate(heavy, HOFFMANN.nominal().drop_vars("friction", errors="ignore"), progress=False)
    low, high = (float(found[f"probability_{end}"][0]) for end in ("low", "high"))
    assert heavy.upper == 1e3
    truth = stats.levy(scale=0.1).sf(published.HOFFMANN_ONSET)
    # Unstable from the onset on, also where it is not swept.
    assert high == pytest.approx(truth, rel=1e-10)
    assert low == pytest.approx(truth - stats.levy(scale=0.1).sf(1e3), rel=1e-10)
    coin = hipuq.integrate_friction(HOFFMANN, stats.binom(1, 0.5))
    assert (coin.lower, coin.upper) == (0.0, 1.0)
    assert float(hipuq.evaluate(coin, coin.nominal(), progress=False)["probability"][0]) == 0.5


def test_a_support_that_ends_at_a_boundary():
    """The boundary is none inside the range: stable up to it, unstable from it on."""
    ((one,),) = boundaries(HOFFMANN.pencils(HOFFMANN.nominal()), 0.0, 0.8)
    for low, high, expected in ((0.0, one.friction, 0.0), (one.friction, 0.8, 1.0)):
        model = hipuq.integrate_friction(HOFFMANN, cp.Uniform(low, high))
        found = hipuq.evaluate(model, model.nominal(), progress=False)
        assert float(found["probability"][0]) == expected
        # chaospy rounds the end of its support.
        assert float(found["onset"][0]) == pytest.approx(one.friction if expected else np.inf, rel=1e-15)
        assert int(found["status"][0]) == 0


def test_nothing_else_need_be_uncertain():
    """One evaluation, no sampling error; methods that share out variance say that there are no inputs."""
    model = hipuq.integrate_friction(hipuq.models.two_dof("hoffmann2002"), cp.Uniform(0.0, 0.8))
    inputs = model.inputs()
    assert len(inputs) == 0
    results = hipuq.run(model, inputs, method="monte_carlo", n=1, of="probability", rng=0)
    for name in ("probability", "probability_low", "probability_high"):
        assert float(results[name]) == pytest.approx(published.HOFFMANN_PROBABILITY, abs=5e-11)
    assert results.attrs["confidence"] == 1.0
    outcomes = hipuq.evaluate(model, hipuq.design("monte_carlo", inputs, n=1, rng=0))
    assert hipuq.fragility(outcomes, [0.4, 0.5])["probability_low"].values.tolist() == [0.0, 1.0]
    for method in ("sobol", "chaos"):
        with pytest.raises(InputError, match="there are no inputs"):
            hipuq.run(model, inputs, method=method, n=16, of="probability", rng=0)
    with pytest.raises(InputError, match="there are no inputs"):
        hipuq.models.two_dof().inputs()
