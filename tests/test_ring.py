"""The ring of oscillators: assembly, published geometry, certified frequencies and onsets, damping.

Source of the equations and Table 1: Oberst et al., INTER-NOISE 2016, p. 5539. Reference frequencies
and onsets are certified by exact rational characteristic polynomials.
"""

import itertools

import numpy as np
import published
import pytest

import hipuq
from hipuq.cea import damping_ratio
from hipuq.errors import InputError, SchemaError, UnknownNameError


def literal_matrices(values: dict, friction: float):
    """Return M, K0 and mu K1 as the paper's equations 2 to 7 spell them out, entry by entry."""
    n = len(values["mass"])
    mass, stiffness, pull = np.zeros((3, 2 * n, 2 * n))

    def spring(j):
        c = np.cos(np.deg2rad(values["spring_angle"][j]))
        s = np.sin(np.deg2rad(values["spring_angle"][j]))
        return values["spring_stiffness"][j] * np.array([[c * c, s * c], [s * c, s * s]])

    for i in range(n):
        here = slice(2 * i, 2 * i + 2)
        mass[here, here] = values["mass"][i] * np.eye(2)
        stiffness[here, here] += spring(i) + spring(i + 1)
        if i + 1 < n:
            there = slice(2 * i + 2, 2 * i + 4)
            stiffness[here, there] -= spring(i + 1)
            stiffness[there, here] -= spring(i + 1)
        if values["contact"][i]:
            b, f = np.deg2rad(values["contact_angle"][i]), np.deg2rad(values["friction_angle"][i])
            normal = np.array([np.cos(b), np.sin(b)])
            tangent = np.array([np.cos(f), np.sin(f)])
            for p, q in itertools.product(range(2), range(2)):
                stiffness[2 * i + p, 2 * i + q] += values["contact_stiffness"][i] * normal[p] * normal[q]
                pull[2 * i + p, 2 * i + q] += (
                    friction * values["contact_stiffness"][i] * tangent[p] * normal[q]
                )
    return mass, stiffness, pull


@pytest.mark.parametrize("n", [5, 9, 12])
def test_assembly_follows_the_equations(n):
    """Every entry of M, K0 and mu K1 for random parameters, three samples at once."""
    rng = np.random.default_rng(n)
    model = hipuq.models.ring(oscillators=n)
    values = {
        "mass": rng.uniform(10, 30, (3, n)),
        "spring_stiffness": rng.uniform(0.5e9, 2e9, (3, n + 1)),
        "contact_stiffness": rng.uniform(1e9, 5e9, (3, n)),
        "spring_angle": rng.uniform(0, 360, (3, n + 1)),
        "contact_angle": rng.uniform(0, 360, (3, n)),
        "friction_angle": rng.uniform(0, 360, (3, n)),
        "contact": rng.random((3, n)) < 0.7,
    }
    friction = np.array([0.0, 0.05, -0.3])
    pencils = model.pencils(model.nominal(friction=friction, **values))
    for i in range(3):
        sample = {name: value[i] for name, value in values.items()}
        mass, stiffness, pull = literal_matrices(sample, friction[i])
        assert np.diag(pencils.mass[i]) == pytest.approx(mass)
        assert pencils.stiffness[i] == pytest.approx(stiffness, abs=1e-12 * stiffness.max())
        total = pencils.total_stiffness[i]
        assert total == pytest.approx(stiffness + pull, abs=1e-12 * stiffness.max())


def test_nominal_geometry_is_that_of_table_1():
    nominal = {name: p.nominal for name, p in hipuq.models.ring("oberst2016").parameters.items()}
    assert nominal["spring_angle"] == pytest.approx(published.SPRING_ANGLES)
    assert nominal["contact_angle"] == pytest.approx(published.CONTACT_ANGLES)
    assert nominal["friction_angle"] % 360 == pytest.approx(published.FRICTION_ANGLES)
    assert nominal["mass"] == pytest.approx(published.MASS)
    assert nominal["spring_stiffness"] == pytest.approx(published.SPRING_STIFFNESS)
    assert nominal["contact_stiffness"] == pytest.approx(published.CONTACT_STIFFNESS)


def test_the_calibrated_preset_changes_the_contact_stiffness_only():
    printed = hipuq.models.ring("oberst2016").parameters
    calibrated = hipuq.models.ring("oberst2016-calibrated").parameters
    changed = [
        name for name in printed if not np.array_equal(printed[name].nominal, calibrated[name].nominal)
    ]
    assert changed == ["contact_stiffness"]
    ratio = calibrated["contact_stiffness"].nominal / calibrated["spring_stiffness"].nominal[:9]
    assert ratio == pytest.approx(published.CALIBRATED_RATIO)


def test_natural_frequencies_are_the_certified_ones():
    model = hipuq.models.ring("oberst2016")
    frequency = model(model.nominal(friction=0.0))["frequency"].values[0]
    assert frequency == pytest.approx(published.NATURAL_FREQUENCIES, abs=6e-4)


@pytest.mark.parametrize("preset", published.ONSETS)
def test_one_pair_after_the_other_becomes_unstable(preset):
    """At each certified onset one more mode is unstable; only close to it may it be unknown."""
    model = hipuq.models.ring(preset)
    for before, onset in enumerate(published.ONSETS[preset]):
        for distance, friction in ((-1e-3, onset * (1 - 1e-3)), (1e-3, onset * (1 + 1e-3))):
            outcomes = model(model.nominal(friction=friction))
            unstable = outcomes["unstable"].values[0]
            expected = before + (distance > 0)
            known = int((unstable == 1).sum())
            assert known <= expected <= known + int(np.isnan(unstable).sum())
            if expected:
                assert outcomes["any_unstable"].values.tolist() == [1]
            if before:  # away from the cluster of the first onset nothing is left open
                assert known == expected and not np.isnan(unstable).any()
    assert unstable.nonzero()[0].tolist() == [11, 13, 15, 17]


@pytest.mark.parametrize("preset", published.ONSETS)
def test_well_below_the_first_onset_all_is_known_to_be_stable(preset):
    model = hipuq.models.ring(preset)
    friction = np.linspace(0.0, 0.9 * published.ONSETS[preset][0], 50)
    assert (model(model.nominal(friction=friction))["any_unstable"] == 0).all()


@pytest.mark.parametrize("missing", published.FIRST_ONSET_WITHOUT)
def test_first_onsets_with_eight_in_contact(missing):
    model = hipuq.models.ring("oberst2016")
    onset = published.FIRST_ONSET_WITHOUT[missing]
    contact = np.arange(1, 10) != missing
    steps = onset * np.array([0.5, 1 - 1e-3, 1 + 1e-3])
    far, below, above = model(model.nominal(friction=steps, contact=contact))["any_unstable"].values
    assert far == 0
    assert below != 1
    assert above == 1


def test_the_calibrated_preset_reproduces_the_printed_lock_in():
    """O2016 prints 0.056 for mode 15: the second onset."""
    onset = published.ONSETS["oberst2016-calibrated"][1]
    assert onset == pytest.approx(published.PRINTED_LOCK_IN_MODE_15, abs=5e-4)


def test_the_calibrated_preset_reproduces_the_printed_shapes():
    """O2016, figure 4: modes 15 and 18 are dominated by the leftmost oscillator."""
    for preset, leftmost in (("oberst2016-calibrated", True), ("oberst2016", False)):
        model = hipuq.models.ring(preset)
        shapes = model.mode_shapes(model.nominal(friction=0.1)).sel(mode=18)
        size = np.hypot(shapes["displacement_real"], shapes["displacement_imag"]).max("axis")
        assert (int(size.argmax("oscillator")) == 0) is leftmost


def test_friction_angle_follows_the_contact_angle():
    """Friction stays perpendicular to the contact unless a direction of its own is given."""
    angle = published.CONTACT_ANGLES + np.linspace(-3, 3, 9)
    model = hipuq.models.ring()
    sample = model.nominal(friction=0.1, contact_angle=angle)
    followed = model.pencils(sample).friction_stiffness
    given = model.pencils(model.nominal(friction=0.1, contact_angle=angle, friction_angle=angle + 90))
    assert np.array_equal(followed, given.friction_stiffness)
    built = hipuq.models.ring(contact_angle=angle)
    assert np.array_equal(built.pencils(built.nominal(friction=0.1)).friction_stiffness, followed)
    fixed = hipuq.models.ring(friction_angle=published.FRICTION_ANGLES)
    assert not np.array_equal(fixed.pencils(sample).friction_stiffness, followed)


def test_modal_damping_gives_every_mode_its_ratio():
    """Without friction the modes of M, K0 decouple, and each has exactly the ratio asked for."""
    model = hipuq.models.ring(damping_ratio=0.0123, contact_stiffness=np.linspace(3e9, 5e9, 9))
    outcomes = model(model.nominal(friction=0.0))
    ratio = damping_ratio(outcomes["frequency"].values, outcomes["growth_rate"].values)
    assert ratio == pytest.approx(0.0123, rel=1e-9)
    undamped = hipuq.models.ring(contact_stiffness=np.linspace(3e9, 5e9, 9))
    natural = undamped(undamped.nominal(friction=0.0))["frequency"].values
    assert outcomes["frequency"].values == pytest.approx(natural * np.sqrt(1 - 0.0123**2), rel=1e-9)


def test_rayleigh_damping_gives_its_ratio():
    """a M + b K0 damps a mode of natural frequency w with the ratio a / (2 w) + b w / 2."""
    model = hipuq.models.ring(mass_damping=20.0, stiffness_damping=1e-6)
    outcomes = model(model.nominal(friction=0.0))
    ratio = damping_ratio(outcomes["frequency"].values[0], outcomes["growth_rate"].values[0])
    w = 2 * np.pi * np.array(published.NATURAL_FREQUENCIES)
    assert ratio == pytest.approx(20.0 / (2 * w) + 1e-6 * w / 2, rel=1e-5)


def test_modal_damping_leaves_mechanisms_free():
    model = hipuq.models.ring(damping_ratio=0.01)
    contact = np.array([True] * 6 + [False] * 3)
    outcomes = model(model.nominal(friction=0.0, contact=contact))
    ratio = damping_ratio(outcomes["frequency"].values[0, 2:], outcomes["growth_rate"].values[0, 2:])
    assert ratio == pytest.approx(0.01, rel=1e-6)
    assert (outcomes["growth_rate"].values[0, :2] == 0).all()
    assert (outcomes["any_unstable"] == 0).all()


def test_damping_of_two_percent_removes_the_instability():
    """Growth at full contact is small: some modal damping outweighs it at every friction to 0.1."""
    model = hipuq.models.ring("oberst2016-calibrated", damping_ratio=0.02)
    outcomes = model(model.nominal(friction=np.linspace(0, 0.1, 30)))
    assert (outcomes["any_unstable"] == 0).all()


@pytest.mark.parametrize("preset", published.ONSETS)
def test_mechanisms_and_no_divergence(preset):
    """Too few contacts leave rigid mechanisms; no pattern of 6 or 7 diverges for friction to 0.1."""
    model = hipuq.models.ring(preset)
    for count, expected in ((6, 2), (7, 1), (8, 0), (9, 0)):
        patterns = hipuq.ContactPatterns(count).samples()
        for friction in np.linspace(0.0, 0.1, 11):
            samples = patterns.assign(friction=("sample", np.full(patterns.sizes["sample"], friction)))
            outcomes = model(samples)
            assert (outcomes["mechanisms"] == expected).all()
            assert (outcomes["frequency"].values[:, :expected] == 0).all()
            assert (outcomes["unstable"].values[:, :expected] == 0).all()
            assert (outcomes["frequency"].values[outcomes["unstable"].values == 1] > 0).all()
            assert (outcomes["frequency"].values[:, expected:] > 0).all()
    matrix = model.pencils(patterns.isel(sample=[0])).total_stiffness[0]
    assert np.linalg.matrix_rank(matrix) == 18


def test_mechanisms_are_the_null_space():
    """The declared number is the rank that the matrices lack, whatever the friction."""
    model = hipuq.models.ring()
    patterns = hipuq.ContactPatterns((0, 4, 6, 7, 8)).samples()
    pencils = model.pencils(patterns.assign(friction=("sample", np.full(patterns.sizes["sample"], 0.07))))
    rank = np.linalg.matrix_rank(pencils.total_stiffness, tol=1e-3)
    assert np.array_equal(18 - rank, pencils.mechanisms)


def test_bad_input_is_named():
    cases = [
        (UnknownNameError, "did you mean 'oberst2016'", lambda: hipuq.models.ring("oberst2015")),
        (
            UnknownNameError,
            "did you mean 'spring_stiffness'",
            lambda: hipuq.models.ring(sprung_stiffness=1.0),
        ),
        (InputError, "spring_stiffness is -1 N/m", lambda: hipuq.models.ring(spring_stiffness=-1.0)),
        (InputError, "mass is 0 kg", lambda: hipuq.models.ring(mass=0.0)),
        (InputError, "mass has the shape \\(3,\\)", lambda: hipuq.models.ring(mass=[1.0, 2.0, 3.0])),
        (InputError, "friction is nan", lambda: hipuq.models.ring(friction=np.nan)),
        (InputError, "contact is 0.5", lambda: hipuq.models.ring(contact=0.5)),
        (InputError, "oscillators is 1", lambda: hipuq.models.ring(oscillators=1)),
        (InputError, "growth_threshold is -1", lambda: hipuq.models.ring(growth_threshold=-1)),
    ]
    for error, message, call in cases:
        with pytest.raises(error, match=message):
            call()


def test_bad_samples_are_named():
    model = hipuq.models.ring()
    good = model.nominal(friction=[0.01, 0.02])
    with pytest.raises(InputError, match="friction is nan in sample 1"):
        model(good.assign(friction=("sample", [0.01, np.nan])))
    with pytest.raises(SchemaError, match="mass has the shape"):
        model(good.assign(mass=(("sample", "oscillator"), np.ones((2, 8)))))
    with pytest.raises(UnknownNameError, match="did you mean 'friction'"):
        model(good.rename(friction="frictoin"))
    with pytest.raises(UnknownNameError, match="did you mean 'friction'"):
        model.nominal(frictio=0.1)


def test_elements_go_by_their_labels():
    """Labels in another order are put in order; labels of another kind are refused."""
    model = hipuq.models.ring()
    sample = model.nominal(contact=[True, *[False] * 2, *[True] * 6], friction=0.01)
    labelled = sample.assign_coords(oscillator=np.arange(1, 10))
    turned = labelled.isel(oscillator=slice(None, None, -1))
    assert np.array_equal(model(turned)["frequency"], model(sample)["frequency"])
    with pytest.raises(SchemaError, match="labelled"):
        model(sample.assign_coords(oscillator=np.arange(9)))
    with pytest.raises(SchemaError, match="dims"):
        model(model.nominal(mass=20.0).rename(oscillator="spring"))


@pytest.mark.parametrize("changes", [{}, {"friction_angle": np.linspace(0, 90, 5)}])
def test_options_rebuild_the_model(changes):
    model = hipuq.models.ring("oberst2016-calibrated", oscillators=5, damping_ratio=0.01, **changes)
    options = dict(model.options)
    nominal = options.pop("nominal")
    again = hipuq.models.MODELS[options.pop("model")](**options, **nominal)
    sample = model.nominal(contact_angle=[170.0, 225.0, 270.0, 315.0, 0.0], friction=0.1)
    assert np.array_equal(again(sample)["growth_rate"], model(sample)["growth_rate"])
    assert again.options == model.options


def test_nominal_takes_a_number_for_all_elements():
    model = hipuq.models.ring()
    sample = model.nominal(mass=20.0, friction=[0.0, 0.1])
    assert sample["mass"].shape == (2, 9)
    assert (sample["mass"] == 20).all()
    with pytest.raises(InputError, match="mass has the shape"):
        model.nominal(mass=[1.0, 2.0])
