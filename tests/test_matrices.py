"""Matrices of any origin as a model: those of known models, of SciPy, and through every analysis."""

import json

import chaospy as cp
import numpy as np
import published
import pytest
import scipy.linalg
import scipy.sparse

import hipuq
from hipuq import schema
from hipuq.models import CEAModel, from_matrices

CONTACT = {"stiffness": [[0, 0], [0, 11]], "friction_stiffness": [[0, -11], [0, 0]]}
SPRINGS = [[23.25, 9 * 0.75**0.5 / 2], [9 * 0.75**0.5 / 2, 7.75]]
NONE = np.zeros((2, 2))


def hoffmann(**options) -> CEAModel:
    """Return the model of Hoffmann et al., its contact spring apart."""
    return from_matrices([1, 1], SPRINGS, NONE, parts={"contact_factor": CONTACT}, **options)


def of_model(model: CEAModel, **options) -> CEAModel:
    """Return the nominal matrices of a model as a model."""
    pencils = model.pencils(model.nominal())
    damping = None if pencils.damping is None else pencils.damping[0]
    return from_matrices(
        pencils.mass[0], pencils.stiffness[0], pencils.friction_stiffness[0], damping, **options
    )


def random_matrices(seed: int, n: int) -> dict[str, np.ndarray]:
    """Return a full mass, a symmetric positive stiffness, a friction stiffness and a damping."""
    rng = np.random.default_rng(seed)
    mass, stiffness, damping = (
        factor @ factor.T + np.eye(n) for factor in rng.normal(scale=0.3, size=(3, n, n))
    )
    return {
        "mass": mass,
        "stiffness": stiffness + np.diag(np.arange(1.0, n + 1)),
        "friction_stiffness": rng.normal(size=(n, n)),
        "damping": 0.02 * damping,
    }


def eigenvalues(mass, stiffness, damping=None) -> np.ndarray:
    """Return the eigenvalues l with Im l >= 0, by SciPy in the state space."""
    n = len(mass)
    damping = np.zeros((n, n)) if damping is None else damping
    states = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
    roots = scipy.linalg.eigvals(states, scipy.linalg.block_diag(np.eye(n), mass))
    return roots[roots.imag >= 0]


@pytest.mark.parametrize("preset", published.ONSETS)
def test_ring(preset):
    """The same matrices: the same bits of everything, and the same probability with friction integrated."""
    ring = hipuq.models.ring(preset)
    model = of_model(ring)
    friction = np.linspace(0.0, 0.1, 41)
    ours, theirs = (one(one.nominal(friction=friction)) for one in (model, ring))
    for name in ("any_unstable", "unstable", "unstable_count", "mechanisms", "status"):
        assert np.array_equal(ours[name], theirs[name]), name
    for name in ("frequency", "growth_rate", "margin"):
        np.testing.assert_allclose(ours[name], theirs[name], rtol=1e-6, atol=1e-6 * theirs[name].max())
    found = hipuq.unstable_friction(model, upper=0.1)
    assert found["friction"].values == pytest.approx(published.ONSETS[preset], rel=1e-6)
    assert found["certified"].all()
    friction = cp.Uniform(0.0, 0.1)
    integrated = [hipuq.integrate_friction(one, friction) for one in (model, ring)]
    ours, theirs = (one(one.nominal())["probability"].item() for one in integrated)
    assert ours == pytest.approx(theirs, abs=1e-9)
    assert ours == pytest.approx(published.PROBABILITY_ANY_UNSTABLE[preset][9], rel=1e-6)


def test_ring_with_mechanisms_and_damping():
    """Six in contact: one mechanism. Damping as a parameter is that of the ring."""
    contact = [1, 1, 1, 0, 0, 0, 1, 1, 1]
    ring = hipuq.models.ring(contact=contact)
    model = of_model(ring, mechanisms=2)
    values = {"friction": [0.01, 0.02, 0.05], "damping_ratio": [0.0, 0.003, 0.01], "mass_damping": 1.0}
    ours, theirs = (one(one.nominal(**values, stiffness_damping=1e-8)) for one in (model, ring))
    assert theirs["mechanisms"].values.tolist() == [2, 2, 2]
    for name in ("any_unstable", "unstable_count", "mechanisms"):
        assert np.array_equal(ours[name], theirs[name]), name
    np.testing.assert_allclose(ours["frequency"], theirs["frequency"], rtol=1e-9, atol=1e-3)


def test_hoffmann():
    model = hoffmann()
    found = hipuq.unstable_friction(model, upper=0.8)
    assert found["friction"].values == pytest.approx([published.HOFFMANN_ONSET], rel=1e-12)
    assert 2 * np.pi * found["frequency"].item() == pytest.approx(published.HOFFMANN_OMEGA, rel=1e-9)
    exact = hipuq.integrate_friction(model, cp.Uniform(0.0, 0.8))
    outcomes = exact(exact.nominal())
    assert outcomes["probability"].item() == pytest.approx(published.HOFFMANN_PROBABILITY, abs=1e-10)
    slopes = hipuq.onset_sensitivity(model, friction=0.4724, frequency=found["frequency"].item())
    theirs = hipuq.onset_sensitivity(
        hipuq.models.two_dof(), friction=0.4724, frequency=found["frequency"].item()
    )
    assert slopes["contact_factor"].item() == pytest.approx(11 * theirs["k3"].item(), rel=1e-9)
    assert slopes["contact_factor"].attrs["units"] == "1"


def test_hulten_with_damping():
    """Damping as a matrix, and the same as a part of it."""
    hulten = hipuq.models.two_dof("hulten", damping_1=0.02, damping_2=0.02)
    pencils = hulten.pencils(hulten.nominal())
    matrices = [pencils.mass[0], pencils.stiffness[0], pencils.friction_stiffness[0]]
    damper = {"damper": {"damping": pencils.damping[0] / 2}}
    for model in (
        from_matrices(*matrices, pencils.damping[0]),
        from_matrices(*matrices, parts=damper, nominal={"damper": 2.0}),
    ):
        assert not {"damping_ratio", "mass_damping", "stiffness_damping"} & set(model.parameters)
        (onset,) = hipuq.unstable_friction(model, upper=1.0)["friction"].values
        assert onset == pytest.approx(published.HULTEN_ONSETS[0.02, 0.02], rel=1e-11)
    (onset,) = hipuq.unstable_friction(model, model.nominal(damper=0.0), upper=1.0)["friction"].values
    assert onset == pytest.approx(published.HULTEN_ONSETS[0.0, 0.0], rel=1e-11)


@pytest.mark.parametrize("damped", [False, True])
def test_parts_against_scipy(damped):
    """Scattered parts of every kind of matrix, a full mass among them, one sample at a time by SciPy."""
    n, size = 7, 24
    base, *parts = (random_matrices(seed, n) for seed in (1, 2, 3))
    if not damped:
        for one in (base, *parts):
            del one["damping"]
    model = from_matrices(**base, parts={"one": parts[0], "two": parts[1]}, nominal={"two": 0.1})
    inputs = model.inputs(
        friction=cp.Uniform(0.0, 1.0),
        one=cp.Uniform(0.0, 0.5),
        two=hipuq.relative(cp.Uniform(-1.0, 1.0)),
    )
    samples = hipuq.design("monte_carlo", inputs, size, 1)
    outcomes = hipuq.evaluate(model, samples, progress=False)
    assert (outcomes["status"] == 0).all()
    assert set(outcomes["any_unstable"].values) == {0.0, 1.0}
    for i in range(size):
        mu, one, two = (samples[name].values[i] for name in ("friction", "one", "two"))
        whole = {kind: base[kind] + one * parts[0][kind] + two * parts[1][kind] for kind in base}
        stiffness = whole["stiffness"] + mu * whole["friction_stiffness"]
        roots = eigenvalues(whole["mass"], stiffness, whole.get("damping"))
        frequency = outcomes["frequency"].values[i]
        theirs = np.sort(roots.imag[roots.imag > 1e-6]) / (2 * np.pi)
        np.testing.assert_allclose(frequency[frequency > 1e-7], theirs, rtol=1e-7)
        assert outcomes["growth_rate"].values[i].max() == pytest.approx(roots.real.max(), abs=1e-7)


def test_full_mass_is_a_change_of_coordinates():
    """``T^T M T``, ``T^T K T``: the same frequencies and verdicts, shapes turned, damping too."""
    ring = hipuq.models.ring(oscillators=4)
    pencils = ring.pencils(ring.nominal())
    turn = np.eye(8) + np.random.default_rng(1).normal(scale=0.2, size=(8, 8))
    mass = np.diag(pencils.mass[0])
    turned = [turn.T @ one @ turn for one in (mass, pencils.stiffness[0], pencils.friction_stiffness[0])]
    model = from_matrices(*turned, mechanisms=0)
    samples = {"friction": [0.0, 0.02, 0.2, 0.6], "damping_ratio": [0.0, 0.0, 0.002, 0.02]}
    samples |= {"mass_damping": [0.0, 0.0, 0.0, 3.0], "stiffness_damping": [0.0, 0.0, 0.0, 1e-8]}
    ours, theirs = (one(one.nominal(**samples)) for one in (model, ring))
    assert np.array_equal(ours["unstable"], theirs["unstable"])
    for name in ("frequency", "growth_rate"):
        np.testing.assert_allclose(ours[name], theirs[name], rtol=1e-7, atol=1e-5)
    shapes = [one.mode_shapes(one.nominal(friction=0.02)) for one in (model, ring)]
    for name in ("frequency", "strain_energy", "kinetic_energy"):
        np.testing.assert_allclose(shapes[0][name], shapes[1][name], rtol=1e-6)


def test_forms_of_a_matrix_are_one_model():
    """Lists, arrays, sparse matrices, a diagonal mass as a vector, -0 and rounding: the same digests."""
    sparse = scipy.sparse.csr_array
    rounding = np.array(SPRINGS) * (1 + np.array([[0, 1e-15], [0, 0]]))
    options = [
        from_matrices([1, 1], SPRINGS, NONE, parts={"contact_factor": CONTACT}).options,
        from_matrices(
            sparse(np.eye(2)),
            sparse(np.array(SPRINGS)),
            -sparse((2, 2)),
            parts={"contact_factor": {kind: scipy.sparse.coo_array(one) for kind, one in CONTACT.items()}},
        ).options,
        from_matrices(np.eye(2), np.array(SPRINGS, ">f8"), -NONE, parts={"contact_factor": CONTACT}).options,
    ]
    assert options[0] == options[1] == options[2]
    assert np.allclose(rounding, SPRINGS)
    symmetric = from_matrices([1, 1], rounding, NONE)
    assert "damping_ratio" in symmetric.parameters
    stiffness = symmetric.pencils(symmetric.nominal()).stiffness[0]
    assert np.array_equal(stiffness, stiffness.T)


def test_nothing_given_is_changed_or_kept():
    given = random_matrices(1, 4)
    part = random_matrices(2, 4)
    before = {name: value.copy() for name, value in (given | {f"{k} 2": v for k, v in part.items()}).items()}
    model = from_matrices(**given, parts={"one": part})
    first = model(model.nominal(friction=0.3))
    for name, value in (given | {f"{k} 2": v for k, v in part.items()}).items():
        assert np.array_equal(value, before[name])
        value += 1.0
    assert model(model.nominal(friction=0.3)).equals(first)


def test_says_what_it_is():
    model = hoffmann(label="two springs", growth_threshold=2.5, certify="always", mechanisms=0)
    assert model.label == "two springs"
    assert model.dofs == 2
    assert list(model.parameters)[:2] == ["friction", "contact_factor"]
    options = json.loads(json.dumps(model.options))
    assert (options["growth_threshold"], options["certify"], options["mechanisms"]) == (2.5, "always", 0)
    assert set(options["matrices"]) == {
        "mass", "stiffness", "friction_stiffness",
        "contact_factor.stiffness", "contact_factor.friction_stiffness",
    }  # fmt: skip
    assert options["nominal"]["contact_factor"] == 1.0
    sample = model.nominal(contact_factor=[0.9, 1.1])
    assert sample["contact_factor"].attrs == {"long_name": "factor of contact_factor", "units": "1"}
    outcomes = hipuq.evaluate(model, sample, progress=False)
    assert outcomes.attrs["model"] == "two springs"
    assert set(outcomes["decided_by"].values) == {schema.DECIDED_BY["certificate"]}


def test_blocks_do_not_count():
    """Large matrices come in small blocks; the numbers are those of any other cut."""
    given = random_matrices(1, 12)
    model = from_matrices(**given, parts={"one": {"stiffness": given["stiffness"]}})
    assert model.block == CEAModel.block
    assert from_matrices(np.ones(100), np.diag(np.arange(1.0, 101)), np.zeros((100, 100))).block == 419
    samples = model.nominal(friction=np.linspace(0.0, 1.0, 11), one=np.linspace(0.5, 1.5, 11))
    whole = model(samples)
    for i in range(11):
        assert model(samples.isel(sample=[i])).equals(whole.isel(sample=[i]))
