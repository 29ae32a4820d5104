"""Polynomial chaos: known indices and probabilities, levels, honesty about the fit, answers at the edges."""

import chaospy as cp
import numpy as np
import pytest
import xarray as xr
from functions import ishigami, sobol_g
from scipy.special import ndtr

import hipuq
from hipuq.methods.chaos import design, evaluations

LINE = hipuq.Inputs(x=cp.Uniform(0.0, 1.0), z=cp.Normal(0.0, 1.0))


def line(samples: xr.Dataset) -> xr.Dataset:
    """Return a distance that is Gaussian around x: below 0 with a probability known by quadrature."""
    return xr.Dataset({"y": samples["x"] + 0.5 * samples["z"]})


def run(model, inputs, n, **options):
    return hipuq.run(model, inputs, method="chaos", n=n, **{"of": "y", "rng": 0, **options})


def test_ishigami():
    known = ishigami()
    results = run(known.model, known.inputs, 1500, degree=10)
    assert results["S1"].values == pytest.approx(known.first, abs=2e-3)
    assert results["ST"].values == pytest.approx(known.total, abs=2e-3)
    both = known.total[0] - known.first[0]
    assert results["S2"].sel(parameter="x1", parameter_2="x3").item() == pytest.approx(both, abs=2e-3)
    assert float(results["mean"]) == pytest.approx(known.mean, abs=0.01)
    assert float(results["variance"]) == pytest.approx(known.variance, rel=0.01)
    assert float(results["q2"]) > 0.999
    assert int(results["trusted"]) == 1
    assert int(results["degree"]) == 10


def test_sobol_g():
    known = sobol_g()
    results = run(known.model, known.inputs, 1500, degree=10)
    assert results["S1"].values == pytest.approx(known.first, abs=2e-3)
    assert results["ST"].values == pytest.approx(known.total, abs=2e-3)


@pytest.mark.parametrize("fit", ["least_squares", "sparse"])
def test_the_degree_is_found(fit):
    inputs = hipuq.Inputs(**{f"x{i}": cp.Uniform(-1.0, 1.0) for i in range(4)})

    def model(samples):
        return xr.Dataset({"y": samples["x0"] ** 3 + samples["x1"] * samples["x2"] + 2})

    results = run(model, inputs, 200, fit=fit)
    assert int(results["degree"]) == 3
    assert float(results["loo"]) < 1e-20
    # var x^3 = 1/7, var x1 x2 = 1/9
    assert float(results["variance"]) == pytest.approx(1 / 7 + 1 / 9, rel=1e-9)
    assert results["ST"].values == pytest.approx(np.array([9, 7, 7, 0]) / 16, abs=1e-9)


def test_quadrature_is_exact_for_polynomials():
    inputs = hipuq.Inputs(a=cp.Uniform(2.0, 4.0), b=cp.Normal(1.0, 2.0))

    def model(samples):
        return xr.Dataset({"y": samples["a"] ** 2 * samples["b"]})

    results = run(model, inputs, 4, sampler="quadrature")
    # E a^2 = 28/3, E a^4 = 992/10, E b = 1, E b^2 = 5
    assert float(results["mean"]) == pytest.approx(28 / 3, rel=1e-12)
    assert float(results["variance"]) == pytest.approx(99.2 * 5 - (28 / 3) ** 2, rel=1e-12)
    assert int(results["samples_used"]) == 16
    with pytest.raises(hipuq.HipuqError, match="10 quadrature nodes for each of 9 inputs"):
        run(model, hipuq.Inputs(**{f"x{i}": cp.Uniform(0, 1) for i in range(9)}), 10, sampler="quadrature")
    with pytest.raises(hipuq.HipuqError, match="needs the sampler 'quadrature', not 'sobol'"):
        run(model, inputs, 64, fit="quadrature")
    with pytest.raises(hipuq.HipuqError, match="at most 50"):
        run(model, inputs, 70, sampler="quadrature")
    with pytest.raises(hipuq.HipuqError, match="degree is 5"):
        run(model, inputs, 4, sampler="quadrature", degree=5)


@pytest.mark.parametrize("sampler", ["random", "latin_hypercube", "sobol", "quadrature"])
def test_a_design_may_be_made_by_rows(sampler):
    inputs = hipuq.models.ring("oberst2016").inputs(
        friction=cp.Uniform(0.0, 0.1), contact=hipuq.ContactPatterns(in_contact=(8, 9))
    )
    n = 4
    whole = design(inputs, n, 3, sampler=sampler, held_out=0.5)
    assert whole.sizes["sample"] == evaluations(inputs, n, sampler=sampler, held_out=0.5) == 60
    assert int((whole["stratum"] == 0).sum()) == 20
    for rows in (slice(0, 7), slice(35, 45), slice(42, 60)):
        part = design(inputs, n, 3, rows=rows, sampler=sampler, held_out=0.5)
        assert part.equals(whole.isel(sample=rows))
    contacts = whole["contact"].values[:40].reshape(10, 4, 9)
    assert (contacts == contacts[:, :1]).all()
    assert len(np.unique(contacts[:, 0], axis=0)) == 10


PATTERNS = hipuq.ContactPatterns(in_contact=(1, 2), oscillators=3)
LEVELS = hipuq.Inputs(a=cp.Uniform(-1.0, 1.0), b=cp.Uniform(-1.0, 1.0), contact=PATTERNS)


def by_level(samples: xr.Dataset) -> xr.Dataset:
    """Return k + k a + b with k in contact: 1 or 2, equally likely."""
    k = samples["contact"].sum("oscillator")
    return xr.Dataset({"y": k + k * samples["a"] + samples["b"]})


def test_levels_by_total_probability():
    """Every index of a function that is linear at each level, by hand.

    Var = E(k^2)/3 + 1/3 + var k = 2.5/3 + 1/3 + 1/4; a alone (1.5^2)/3, a with k var(k)/3.
    """
    results = run(by_level, LEVELS, 20)
    variance = 2.5 / 3 + 1 / 3 + 0.25
    assert float(results["variance_overall"]) == pytest.approx(variance, rel=1e-9)
    assert float(results["mean_overall"]) == pytest.approx(1.5, rel=1e-9)
    assert results["mean"].dims == ("pattern",)
    assert results["mean"].values == pytest.approx(results["in_contact"].values, rel=1e-9)
    assert results["parameter"].values.tolist() == ["a", "b", "contact"]
    assert results["S1"].values * variance == pytest.approx([0.75, 1 / 3, 0.25], rel=1e-9)
    assert results["ST"].values * variance == pytest.approx([2.5 / 3, 1 / 3, 0.25 + 0.25 / 3], rel=1e-9)
    together = results["S2"].sel(parameter="a", parameter_2="contact").item()
    assert together * variance == pytest.approx(0.25 / 3, rel=1e-9)
    assert float(results["q2"]) == pytest.approx(1.0, abs=1e-9)
    assert float(results["loo_overall"]) < 1e-20


def test_levels_of_samples_that_were_not_designed_for_it():
    """Plain samples over everything have levels too; those of other levels are refused."""
    samples = hipuq.design("monte_carlo", LEVELS, 600, 4)
    outcomes = hipuq.evaluate(by_level, samples)
    results = hipuq.estimate("chaos", outcomes, LEVELS, of="y")
    assert float(results["mean_overall"]) == pytest.approx(1.5, rel=1e-9)
    assert int(results["samples_used"].sum()) == 500
    other = hipuq.Inputs(
        a=cp.Uniform(-1, 1),
        b=cp.Uniform(-1, 1),
        contact=hipuq.ContactPatterns(in_contact=(2,), oscillators=3),
    )
    with pytest.raises(hipuq.HipuqError, match="none of the levels"):
        hipuq.estimate("chaos", outcomes, other, of="y")
    with pytest.raises(hipuq.HipuqError, match="a continuous input"):
        run(by_level, hipuq.Inputs(contact=PATTERNS), 4)


def test_levels_of_a_stratified_design():
    weighted = hipuq.ContactPatterns(in_contact=(1, 2), oscillators=3, weights=(0.9, 0.1))
    inputs = hipuq.Inputs(a=cp.Uniform(-1.0, 1.0), b=cp.Uniform(-1.0, 1.0), contact=weighted)
    samples = hipuq.design("monte_carlo", inputs, 60, 4, stratify="contact")
    results = hipuq.estimate("chaos", hipuq.evaluate(by_level, samples), inputs, of="y", limit=0.5)
    assert float(results["mean_overall"]) == pytest.approx(1.1, rel=1e-9)
    assert float(results["q2"]) == pytest.approx(1.0, abs=1e-9)
    assert float(results["probability_overall_low"]) < float(results["probability_overall"])


def test_other_dims_are_fitted_each_by_itself():
    def model(samples):
        y = xr.concat([samples["x"], samples["x"] * samples["z"], 0 * samples["x"]], "mode")
        return xr.Dataset({"y": y.transpose("sample", "mode")}, coords={"mode": [1, 2, 3]})

    results = run(model, LINE, 100)
    assert results["S1"].dims == ("parameter", "mode")
    assert results["degree"].values.tolist() == [1, 2, 0]
    assert results["variance"].values == pytest.approx([1 / 12, 1 / 3, 0.0], rel=1e-9)
    assert np.isnan(results["S1"].sel(mode=3)).all()
    assert results["S1"].attrs["undefined"].startswith("mode 3: the outcome does not vary")
    assert results["trusted"].values.tolist() == [1, 1, 0]


def test_elements_or_parameters():
    model = hipuq.models.ring("oberst2016")
    inputs = model.inputs(
        friction=cp.Uniform(0.0, 0.1),
        spring_stiffness=hipuq.relative(cp.Uniform(-0.1, 0.1), each="spring"),
        contact_angle=hipuq.shift(cp.Normal(0.0, 0.5), each="oscillator"),
    )

    def energy(samples):
        springs = samples["spring_stiffness"] / 1.05e9 - 1
        return xr.Dataset({"y": springs.sum("spring") + samples["friction"]})

    results = run(energy, inputs, 100, degree=1)
    own, friction = 10 * 0.01 / 3, 0.01 / 12
    assert results["parameter"].values.tolist() == ["friction", "spring_stiffness", "contact_angle"]
    assert results["S1"].values == pytest.approx(np.array([friction, own, 0]) / (own + friction), abs=1e-9)
    opened = run(energy, inputs, 100, degree=1, groups=False)
    assert opened["parameter"].values.tolist()[:2] == ["friction", "spring_stiffness[1]"]
    assert opened.sizes["parameter"] == 20
    assert opened["S1"].sel(parameter="spring_stiffness[7]").item() * 10 == pytest.approx(
        results["S1"].values[1], rel=1e-6
    )


def probability_of_line() -> float:
    """Return P(x + z/2 < 0) by Gauss quadrature over x."""
    x, w = np.polynomial.legendre.leggauss(50)
    return float((w / 2 * ndtr(-(x + 1))).sum())


def test_the_probability_of_a_limit_state():
    results = run(line, LINE, 400, limit=0.0)
    truth = probability_of_line()
    assert float(results["probability_surrogate"]) == pytest.approx(truth, abs=1e-3)
    assert float(results["misclassified"]) == 0.0
    assert float(results["misclassified_high"]) > 0.0
    assert float(results["probability_low"]) < truth < float(results["probability_high"])


def test_probabilities_are_mended_where_the_surrogate_is_wrong():
    """A polynomial of degree 1 of a step-like function misleads; true evaluations do not.

    Of 40 intervals of 95 % the truth may be missing in 2 and a few more; binomial, 99.9 %: 8.
    """

    def model(samples):
        step = xr.where(samples["x"] < 0.3, -1.0, 2.0)
        return xr.Dataset({"y": samples["z"] + step})

    truth = 0.3 * ndtr(1.0) + 0.7 * ndtr(-2.0)
    missed = {0: 0, 256: 0}
    width = {0: [], 256: []}
    for seed in range(40):
        for correction in missed:
            results = run(
                model, LINE, 60, degree=1, limit=0.0, correction=correction, rng=seed, population=2**12
            )
            low, high = float(results["probability_low"]), float(results["probability_high"])
            missed[correction] += not low <= truth <= high
            width[correction].append(high - low)
    assert max(missed.values()) <= 8
    assert np.mean(width[256]) < 0.4 * np.mean(width[0])


def test_the_correction_is_a_second_round():
    """Its samples are new, random inside strata of equal probability, and counted."""
    samples = hipuq.design("chaos", LINE, 50, 0)
    outcomes = hipuq.evaluate(line, samples)
    options = {"of": "y", "limit": 0.0, "correction": 160}
    record = hipuq.methods.METHODS["chaos"]
    more = record.refine(outcomes, LINE, np.random.default_rng(1), **options)
    assert more.sizes["sample"] == 160
    assert more["sample"].values.tolist() == list(range(60, 220))
    assert (more["round"] == 1).all()
    weights = more["stratum_weight"].groupby(more["stratum"]).first()
    assert weights.values == pytest.approx(1 / 8, abs=1e-3)
    assert record.evaluations(LINE, 50, correction=160) == 220
    results = run(line, LINE, 50, limit=0.0, correction=160)
    assert int(results["evaluations"]) == 220
    assert results.sizes["held_out"] == 10
    again = run(line, LINE, 50, limit=0.0, correction=160)
    assert results.drop_vars("seconds").equals(again.drop_vars("seconds"))
    with pytest.raises(hipuq.HipuqError, match="0 or 128 to 6553 true evaluations"):
        run(line, LINE, 50, limit=0.0, correction=100)
    with pytest.raises(hipuq.HipuqError, match="needs a limit state"):
        run(line, LINE, 50, correction=160)


def constant(value):
    return lambda samples: xr.Dataset({"y": ("sample", np.full(samples.sizes["sample"], value))})


def test_a_constant_outcome():
    results = run(constant(3.5), LINE, 40)
    assert float(results["mean"]) == 3.5
    assert float(results["variance"]) == 0.0
    for name in ("S1", "ST", "S2"):
        assert np.isnan(results[name]).all()
        assert results[name].attrs["undefined"].startswith("the outcome does not vary")
    assert np.isnan(results["q2"]) and np.isnan(results["loo"])
    # A mean of many 0.1 is not 0.1 to the last bit.
    assert np.isnan(run(constant(0.1), LINE, 64)["q2"])
    assert int(results["trusted"]) == 0
    assert "does not vary" in results["trusted"].attrs["reasons"]


@pytest.mark.parametrize("certain", [0, 1])
def test_an_event_that_always_or_never_happens(certain):
    results = run(constant(float(certain)), LINE, 100)
    assert float(results["probability"]) == certain
    ends = float(results["probability_low"]), float(results["probability_high"])
    assert ends[certain] == certain
    # Wilson, 20 held-out samples
    assert abs(ends[1 - certain] - certain) == pytest.approx(0.1611, abs=1e-3)
    corrected = run(constant(float(certain)), LINE, 100, correction=1024)
    assert float(corrected["probability"]) == certain


def test_unknown_outcomes_are_left_out_and_widen_probabilities():
    def model(samples):
        y = line(samples)["y"]
        return xr.Dataset({"y": y.where(samples["x"] > 0.1)})

    results = run(model, LINE, 400, limit=0.0)
    known = run(line, LINE, 400, limit=0.0)
    assert int(results["samples_used"]) == 360
    assert float(results["mean"]) == pytest.approx(0.5, abs=1e-9)
    assert int(results["trusted"]) == 0
    assert "10.0% of the samples to fit are unknown" in results["trusted"].attrs["reasons"]
    width = [float(r["probability_high"] - r["probability_low"]) for r in (results, known)]
    assert width[0] > width[1] + 0.05
    assert int(results["failed"]) == int(np.isnan(results["true"]).sum()) + 40


def test_nothing_known():
    results = run(constant(np.nan), LINE, 40, limit=0.0)
    assert all(np.isnan(results[name]).all() for name in ("mean", "variance", "S1", "q2", "probability"))
    assert results["S1"].attrs["undefined"].startswith("too few samples have a known outcome")
    assert float(results["probability_low"]) == 0.0 and float(results["probability_high"]) == 1.0
    assert int(results["trusted"]) == 0


def test_what_cannot_be_done_says_so():
    with pytest.raises(hipuq.HipuqError, match="y is infinite in 48 samples"):
        run(constant(np.inf), LINE, 40)
    with pytest.raises(hipuq.HipuqError, match="degree"):
        run(line, LINE, 10, degree=5)
    with pytest.raises(hipuq.HipuqError, match="did you mean 'sparse'"):
        run(line, LINE, 10, fit="sparce")
    with pytest.raises(hipuq.HipuqError, match="q is 0"):
        run(line, LINE, 10, q=0)
    with pytest.raises(hipuq.HipuqError, match="held_out is -1"):
        run(line, LINE, 10, held_out=-1)
    with pytest.raises(hipuq.HipuqError, match="limit is nan"):
        run(line, LINE, 10, limit=np.nan)
    with pytest.raises(hipuq.HipuqError, match="groups is 'x'"):
        run(line, LINE, 10, groups="x")
    with pytest.raises(hipuq.HipuqError, match="take 512 or 1024"):
        run(line, LINE, 10, population=1000)
    samples = hipuq.design("chaos", LINE, 10, 0)
    with pytest.raises(hipuq.HipuqError, match="'z'"):
        outcomes = hipuq.evaluate(line, samples).drop_vars("z")
        hipuq.estimate("chaos", outcomes, LINE, of="y")


def test_without_held_out_samples_nothing_is_trusted():
    results = run(line, LINE, 40, held_out=0, limit=0.0)
    assert float(results["loo"]) < 1e-20
    assert results.sizes["held_out"] == 0
    assert np.isnan(results["q2"]) and np.isnan(results["mean_corrected"])
    assert "0 held-out samples are too few" in results["trusted"].attrs["reasons"]


def test_the_surrogate_can_be_made_again_from_the_results(tmp_path):
    results = run(line, LINE, 60, limit=0.0)
    hipuq.save_results(results, tmp_path / "results.nc")
    again = hipuq.load_results(tmp_path / "results.nc").to_dataset()
    assert again.identical(results)
    x = 2 * 0.3 - 1
    value = 0.0
    for term in again["term"].values:
        degree = dict(zip(again["element"].values, again["multi_index"].sel(term=term).values, strict=True))
        product = {0: 1.0, 1: np.sqrt(3) * x}.get(degree["x"], np.nan) * {0: 1.0, 1: 0.7}.get(
            degree["z"], np.nan
        )
        value += float(again["coefficient"].sel(term=term)) * (product if np.isfinite(product) else 0.0)
    assert value == pytest.approx(0.3 + 0.5 * 0.7, rel=1e-9)


def test_a_probability_is_a_mean_between_0_and_1():
    """Friction integrated: the surrogate is a control variate, limits stay inside."""
    exact = hipuq.integrate_friction(hipuq.models.two_dof("hoffmann2002"), cp.Uniform(0.0, 0.8))
    inputs = exact.inputs(k3=hipuq.relative(cp.Uniform(-0.1, 0.1)), k1=hipuq.relative(cp.Uniform(-0.1, 0.1)))
    results = hipuq.run(exact, inputs, method="chaos", n=60, of="probability", rng=0)
    plain = hipuq.run(exact, inputs, method="monte_carlo", n=512, sampler="sobol", of="probability", rng=0)
    assert float(results["probability"]) == pytest.approx(float(plain["probability"]), abs=1e-4)
    assert float(results["probability_low"]) < float(plain["probability_high"])
    assert float(results["probability_high"]) > float(plain["probability_low"])
    assert float(results["probability_high"] - results["probability_low"]) < 1e-4
    assert float(results["q2"]) > 0.99
