import subprocess
import sys

import chaospy as cp
import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import hipuq
from hipuq import plots
from hipuq.errors import InputError, SchemaError

CALIBRATED = "oberst2016-calibrated"
LEFT_OUT = "not shown: 1-10 (never unstable)"
PAPER_NAMES = {12: "11", 14: "14", 16: "15", 18: "18"}


@pytest.fixture(autouse=True)
def pyplot_untouched():
    from matplotlib import pyplot as plt

    before = dict(mpl.rcParams)
    yield
    assert plt.get_fignums() == []
    assert dict(mpl.rcParams) == before


def sweep_of(model, stop=0.1, points=201):
    return hipuq.evaluate(model, model.nominal(friction=np.linspace(0, stop, points)), progress=False)


@pytest.fixture(scope="module")
def sweeps():
    # Without certificates some verdicts stay open, which the figures have to show.
    return {
        preset: sweep_of(hipuq.models.ring(preset, certify="never"), points=1001)
        for preset in ("oberst2016", CALIBRATED)
    }


@pytest.fixture(scope="module")
def sweep(sweeps):
    return sweeps[CALIBRATED]


@pytest.fixture(scope="module")
def damped():
    return sweep_of(hipuq.models.ring(CALIBRATED, damping_ratio=0.02))


@pytest.fixture(scope="module")
def mechanisms():
    """Ring of six in contact: three springs too few, so two to three modes have frequency 0."""
    return sweep_of(hipuq.models.ring(CALIBRATED, contact=[1, 1, 0, 1, 0, 1, 0, 1, 1]))


@pytest.fixture(scope="module")
def results():
    model = hipuq.models.ring(CALIBRATED)
    contact = hipuq.ContactPatterns(in_contact=(6, 7, 8, 9))
    inputs = model.inputs(friction=cp.Uniform(0, 0.1), contact=contact)
    samples = hipuq.design("monte_carlo", inputs, n=20, rng=1, stratify="contact")
    outcomes = hipuq.evaluate(model, samples, keep=["unstable"], progress=False)
    return hipuq.estimate("monte_carlo", outcomes, inputs, of="unstable")


@pytest.fixture(scope="module")
def shapes():
    model = hipuq.models.ring(CALIBRATED)
    return model.mode_shapes(model.nominal(friction=0.1))


def test_pyplot_is_not_imported():
    code = "import sys, hipuq.plots; hipuq.plots.occurrence; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def line(ax, label):
    return next(drawn for drawn in ax.lines if drawn.get_label() == label)


def labels(ax):
    return ax.get_legend_handles_labels()[1]


def drawn(ax):
    """Draw the whole figure, which runs the layout: a warning there is an error here."""
    ax.figure.draw_without_rendering()
    return ax


def means(ax):
    return ax.containers[0].lines[0].get_ydata()


# Every figure


FIGURES = {
    "occurrence": lambda data, ax: plots.occurrence(data["results"], 7, ax=ax),
    "mode_shape": lambda data, ax: plots.mode_shape(data["shapes"], 18, ax=ax),
    "frequency_over_friction": lambda data, ax: plots.frequency_over_friction(data["sweep"], [15, 16], ax=ax),
    "growth_over_friction": lambda data, ax: plots.growth_over_friction(data["sweep"], [15, 16], ax=ax),
    "root_locus": lambda data, ax: plots.root_locus(data["sweep"], ax=ax),
    "damping_over_frequency": lambda data, ax: plots.damping_over_frequency(data["sweep"], ax=ax),
}


@pytest.mark.parametrize("name", FIGURES)
def test_axes_given_are_used(name, results, shapes, sweep):
    data = {"results": results, "shapes": shapes, "sweep": sweep}
    ax = Figure().subplots()
    assert FIGURES[name](data, ax) is ax
    other = FIGURES[name](data, None)
    assert isinstance(drawn(other), Axes)
    assert other.figure is not ax.figure


@pytest.mark.parametrize("name", FIGURES)
def test_data_is_not_changed(name, results, shapes, sweep):
    data = {"results": results, "shapes": shapes, "sweep": sweep}
    before = {key: value.copy(deep=True) for key, value in data.items()}
    FIGURES[name](data, None)
    assert all(value.identical(before[key]) for key, value in data.items())


@pytest.mark.parametrize(
    ("name", "x", "y"),
    [
        (
            "occurrence",
            f"pair of modes, by ascending frequency\n{LEFT_OUT}",
            "probability: mode unstable [%]",
        ),
        ("mode_shape", "x [radii]", "y [radii]"),
        ("frequency_over_friction", "friction coefficient [1]", "frequency [Hz]"),
        ("growth_over_friction", "friction coefficient [1]", "growth rate [1/s]"),
        ("root_locus", "frequency [Hz]", "growth rate [1/s]"),
        ("damping_over_frequency", "frequency [Hz]", "damping ratio [1]"),
    ],
)
def test_labels_have_units(name, x, y, results, shapes, sweep):
    ax = FIGURES[name]({"results": results, "shapes": shapes, "sweep": sweep}, None)
    assert (ax.get_xlabel(), ax.get_ylabel()) == (x, y)


# Occurrence


def test_occurrence_shows_percent(results):
    ax = plots.occurrence(results, 7)
    part = results.sel(count=7, mode=slice(11, 18))
    np.testing.assert_allclose(means(ax), 100 * part["probability_mean"])
    assert ax.get_title() == "7 in contact, 36 patterns"
    spread = (part["probability_max"] > part["probability_min"]).values
    np.testing.assert_allclose(line(ax, "maximum").get_ydata(), 100 * part["probability_max"][spread])
    np.testing.assert_allclose(line(ax, "minimum").get_ydata(), 100 * part["probability_min"][spread])
    assert "mean, 95 % interval" in labels(ax)


def test_occurrence_names_pairs_and_paper(results):
    ax = plots.occurrence(results, 9, modes=[12, 14, 16, 18], names=PAPER_NAMES)
    ticks = [tick.get_text() for tick in ax.get_xticklabels()]
    assert ticks == ["11-12\n(11)", "13-14\n(14)", "15-16\n(15)", "17-18\n(18)"]
    # Modes that nobody asked for need no word.
    assert ax.get_xlabel() == "pair of modes, by ascending frequency (name in the paper)"


def test_single_pattern_has_no_spread(results):
    ax = drawn(plots.occurrence(results, 9))
    assert ax.get_title() == "9 in contact, 1 pattern"
    assert labels(ax) == ["mean, 95 % interval"]


def test_zero_probability_stands_at_zero(results):
    ax = drawn(plots.occurrence(results, 6, modes=[1, 2]))
    assert means(ax).tolist() == [0.0, 0.0]
    assert "maximum" not in labels(ax)


def test_unknown_probability_is_marked(results):
    unknown = results.where(results["mode"] != 18)
    ax = drawn(plots.occurrence(unknown, 8))
    assert [text.get_text() for text in ax.texts] == ["?"]
    nothing = drawn(plots.occurrence(results.where(results["mode"] < 0), 8))
    assert len(nothing.texts) == 8
    assert np.isnan(means(nothing)).all()


def test_occurrence_works_without_limits(results):
    bare = results[["probability_min", "probability_mean", "probability_max"]].drop_vars(["pair"])
    bare.attrs = {}
    ax = drawn(plots.occurrence(bare, 8, modes=[17, 18]))
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["17", "18"]
    assert (ax.get_title(), labels(ax)[-1]) == ("8 in contact", "mean")


def test_occurrence_panels(results):
    axes = plots.occurrence_panels(results, names=PAPER_NAMES)
    assert axes.shape == (2, 2)
    titles = [drawn(ax).get_title() for ax in axes.flat]
    assert titles[0] == "(a) 6 in contact, 84 patterns"
    assert titles[3] == "(d) 9 in contact, 1 pattern"
    figure = axes[0, 0].figure
    assert figure.get_supxlabel().endswith(f"(name in the paper)\n{LEFT_OUT}")
    assert figure.get_supylabel() == "probability: mode unstable [%]"
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert sorted(texts) == ["maximum", "mean, 95 % interval", "minimum"]


def test_occurrence_panels_of_some_counts(results):
    figure = Figure()
    axes = plots.occurrence_panels(results, counts=[9, 6, 7], figure=figure)
    assert axes[0, 0].figure is figure
    assert [ax.get_visible() for ax in axes.flat] == [True, True, True, False]
    assert plots.occurrence_panels(results, counts=[9]).shape == (1, 1)


def test_occurrence_refuses(results):
    with pytest.raises(InputError, match=r"count 5 is not in the results.*\[6, 7, 8, 9\]"):
        plots.occurrence(results, 5)
    with pytest.raises(InputError, match="mode 19"):
        plots.occurrence(results, 6, modes=[19])
    with pytest.raises(InputError, match="no mode to draw"):
        plots.occurrence(results, 6, modes=[])
    with pytest.raises(SchemaError, match="stratified analysis"):
        plots.occurrence(results.drop_vars("probability_min"), 6)
    with pytest.raises(SchemaError, match="over \\(count, mode\\)"):
        plots.occurrence_panels(results.isel(mode=0))


@pytest.fixture(scope="module")
def exact(results):
    """What an exact analysis gives: the same quantities, no limits, here with values of their own."""
    names = ["probability_min", "probability_mean", "probability_max"]
    return (0.9 * results[names]).assign_attrs(confidence=1.0)


def test_exact_values_stand_beside_sampled_ones(results, exact):
    ax = drawn(plots.occurrence(results, 7, exact=exact))
    part = exact.sel(count=7, mode=slice(11, 18))
    bars = line(ax, "exact")
    wanted = 100 * np.concatenate([part[f"probability_{end}"] for end in ("min", "mean", "max")])
    np.testing.assert_allclose(bars.get_ydata(), wanted)
    np.testing.assert_array_equal(bars.get_xdata(), np.tile(np.arange(8), 3))
    assert sorted(labels(ax)) == ["exact", "maximum", "mean, 95 % interval", "minimum"]
    # Nothing sampled is drawn otherwise than without them.
    np.testing.assert_array_equal(means(ax), means(plots.occurrence(results, 7)))


def test_exact_values_are_found_by_count_and_mode(results, exact):
    other = exact.isel(count=slice(None, None, -1), mode=slice(None, None, -1))
    before = other.copy(deep=True)
    one, two = (plots.occurrence(results, 8, exact=data, modes=[18, 16]) for data in (exact, other))
    np.testing.assert_array_equal(line(one, "exact").get_xydata(), line(two, "exact").get_xydata())
    assert other.identical(before)


def test_exact_values_in_panels_have_one_legend_entry(results, exact):
    axes = plots.occurrence_panels(results, exact=exact)
    drawn(axes[0, 0])
    texts = [text.get_text() for text in axes[0, 0].figure.legends[0].get_texts()]
    assert texts.count("exact") == 1 and len(texts) == 4
    for ax, count in zip(axes.flat, (6, 7, 8, 9), strict=True):
        highest = 100 * exact["probability_max"].sel(count=count)
        assert line(ax, "exact").get_ydata().max() == pytest.approx(float(highest.max()))


def test_unknown_exact_values_are_left_out(results, exact):
    ax = drawn(plots.occurrence(results, 8, exact=exact * np.nan))
    assert np.isnan(line(ax, "exact").get_ydata()).all()
    assert not ax.texts


def test_exact_results_stand_alone(results, exact):
    ax = drawn(plots.occurrence(exact, 7))
    np.testing.assert_allclose(means(ax), 100 * exact["probability_mean"].sel(count=7, mode=slice(11, 18)))
    assert sorted(labels(ax)) == ["maximum", "mean", "minimum"]
    assert plots.occurrence_panels(exact).shape == (2, 2)
    certain = exact.assign({f"probability_mean_{end}": exact["probability_mean"] for end in ("low", "high")})
    assert sorted(labels(plots.occurrence(certain, 7))) == ["maximum", "mean", "minimum"]
    open_ = certain.assign(probability_mean_high=certain["probability_mean"] + 0.1)
    assert "mean, limits of the unknown" in labels(plots.occurrence(open_, 7))


def test_exact_results_of_another_kind_are_refused(results, exact):
    with pytest.raises(SchemaError, match=r"'probability_max' over \(count, mode\).*'probability_by_mode'"):
        plots.occurrence(results, 7, exact=exact.drop_vars("probability_max"))
    with pytest.raises(SchemaError, match="over \\(count, mode\\)"):
        plots.occurrence_panels(results, exact=exact.isel(count=0))
    with pytest.raises(InputError, match=r"count of the exact results is \[6, 7\].*\[6, 7, 8, 9\]"):
        plots.occurrence(results, 7, exact=exact.sel(count=[6, 7]))
    with pytest.raises(InputError, match="mode of the exact results"):
        plots.occurrence_panels(results, exact=exact.sel(mode=slice(11, 18)))


# Mode shapes


def test_mode_shape_is_scaled(shapes):
    ax = plots.mode_shape(shapes, 18)
    start = np.array(line(ax, "undeformed").get_data()).T
    np.testing.assert_array_equal(start, shapes["position"])
    end = np.array(line(ax, "deformed (largest: 0.25 radii)").get_data()).T
    moved = end - start
    length = np.hypot(*moved.T)
    assert length.max() == pytest.approx(0.25)
    # Dominated by the leftmost oscillator, as in figure 4 of the paper.
    assert length.argmax() == 0
    true = shapes["displacement_real"].sel(mode=18).values
    np.testing.assert_allclose(moved / 0.25, true / np.hypot(*true.T).max(), atol=1e-12)
    assert ax.get_title() == "mode 18: 2323.2 Hz, growth rate 14.6 1/s (growing)"
    assert [text.get_text() for text in ax.texts] == [str(i) for i in range(1, 10)]
    assert ax.get_aspect() == 1.0


def test_mode_shape_of_other_scale_and_no_motion(shapes):
    assert "deformed (largest: 0.5 radii)" in labels(plots.mode_shape(shapes, 1, scale=0.5))
    drawn(plots.mode_shape(shapes.assign(displacement_real=0 * shapes["displacement_real"]), 1))


def test_mode_shape_tells_where_it_is_as_far_as_is_known(shapes):
    told = shapes.assign_coords(friction=0.1).assign_attrs(damping_ratio=0.005)
    first, second = plots.mode_shape(told, 17).get_title().split("\n")
    assert first.endswith("-14.6 1/s (decaying)")
    assert second == "friction 0.1, damping ratio 0.5 %"
    still = plots.mode_shape(told.assign(growth_rate=0 * shapes["growth_rate"]).drop_vars("friction"), 1)
    assert still.get_title().endswith("growth rate 0 1/s\ndamping ratio 0.5 %")


def test_mode_shape_refuses(shapes, sweep):
    with pytest.raises(InputError, match="mode 0"):
        plots.mode_shape(shapes, 0)
    with pytest.raises(InputError, match="scale is 0"):
        plots.mode_shape(shapes, 1, scale=0)
    with pytest.raises(SchemaError, match="displacement_real"):
        plots.mode_shape(sweep, 1)


# Following modes


# Onsets of the pairs from exact characteristic polynomials with rigorously enclosed roots.
@pytest.mark.parametrize(
    ("preset", "mode", "onset"),
    [
        ("oberst2016", 18, 0.00949727246944),
        ("oberst2016", 16, 0.0104569072808),
        ("oberst2016", 14, 0.0127590938754),
        ("oberst2016", 12, 0.0171403736060),
        (CALIBRATED, 18, 0.0530122),
        (CALIBRATED, 16, 0.0560347),
        (CALIBRATED, 14, 0.0620784),
        (CALIBRATED, 12, 0.0701032),
    ],
)
def test_lock_in_bracket_holds_the_exact_onset(sweeps, preset, mode, onset):
    low, high = plots.lock_in_bracket(sweeps[preset], mode)
    assert low < onset < high
    # Double precision leaves the first onset of the cluster undecided for a while.
    assert high - low < (1.1e-4 if mode < 18 else 3e-3)


def test_followed_modes_are_continuous_and_complete(sweeps):
    for outcomes in sweeps.values():
        followed = plots.follow_modes(outcomes)
        np.testing.assert_array_equal(np.sort(followed["frequency"], axis=1), outcomes["frequency"])
        np.testing.assert_array_equal(
            np.sort(followed["growth_rate"], axis=1), np.sort(outcomes["growth_rate"], axis=1)
        )
        for lower in (11, 13, 15, 17):
            pair = followed.sel(mode=[lower, lower + 1])
            coupled = pair["friction"] > plots.lock_in_bracket(outcomes, lower + 1)[1]
            frequency = pair["frequency"].values[coupled]
            np.testing.assert_array_equal(frequency[:, 0], frequency[:, 1])
            growth = pair["growth_rate"].values[coupled]
            assert (growth[:, 1] > 0).all()
            np.testing.assert_allclose(growth[:, 0], -growth[:, 1])


def test_order_of_samples_and_failed_ones_do_not_matter(sweep):
    rows = np.random.default_rng(0).permutation(sweep.sizes["sample"])
    shuffled = sweep.isel(sample=rows)
    failed = shuffled.isel(sample=[0]).copy(deep=True)
    for name in ("frequency", "growth_rate", "unstable"):
        failed[name] = failed[name] * np.nan
    both = xr.concat([failed, shuffled], "sample")
    assert plots.lock_in_bracket(both, 16) == plots.lock_in_bracket(sweep, 16)


def test_sweep_without_instability(sweep, damped):
    below = sweep.isel(sample=slice(0, 400))
    np.testing.assert_array_equal(plots.follow_modes(below)["frequency"], below["frequency"])
    for outcomes in (below, damped):
        assert np.isnan(plots.lock_in_bracket(outcomes, 18)).all()
        axes = plots.lock_in(outcomes)
        end = float(outcomes["friction"].max())
        for ax in axes.flat:
            said = [label for label in labels(drawn(ax)) if "lock-in" in label]
            assert said in (
                [f"never unstable: no lock-in up to friction {end:.4g}"],
                [f"never unstable where known: no lock-in up to friction {end:.4g}"],
            )
        assert labels(drawn(plots.dispersion(outcomes)[0])) == ["never unstable"]
        drawn(plots.root_locus(outcomes))
        assert labels(drawn(plots.damping_over_frequency(outcomes))) == ["stable"]


def test_sweep_unstable_from_the_start(sweep):
    above = sweep.isel(sample=slice(800, None))
    low, high = plots.lock_in_bracket(above, 18)
    assert np.isnan(low) and high == pytest.approx(0.08)
    assert "mode 18: unstable from 0.08" in labels(plots.growth_over_friction(above, [17, 18]))


def test_follow_modes_refuses(sweep):
    with pytest.raises(SchemaError, match="growth_rate"):
        plots.follow_modes(sweep.drop_vars("growth_rate"))
    with pytest.raises(InputError, match="mode 19"):
        plots.lock_in_bracket(sweep, 19)
    with pytest.raises(InputError, match="no sample"):
        plots.follow_modes(sweep.assign(frequency=sweep["frequency"] * np.nan))
    varied = sweep.assign(damping_ratio=("sample", np.linspace(0, 1, sweep.sizes["sample"])))
    with pytest.raises(InputError, match="damping_ratio varies"):
        plots.follow_modes(varied)


# Over friction


def test_frequencies_merge_and_unknown_ones_are_apart(sweep):
    ax = drawn(plots.frequency_over_friction(sweep, [15, 16]))
    followed = plots.follow_modes(sweep)
    for mode in (15, 16):
        chosen = followed.sel(mode=mode)
        known = chosen["unstable"].notnull().values
        shown = line(ax, f"mode {mode}").get_ydata()
        np.testing.assert_array_equal(shown[known], chosen["frequency"].values[known])
        assert np.isnan(shown[~known]).all() and (~known).any()
    assert "undecided" in labels(ax)
    assert "mode 16: lock-in between 0.0560 and 0.0561" in labels(ax)
    apart = [other for other in ax.lines if other.get_markerfacecolor() == "none"]
    assert len(apart) == 2


def test_growth_of_undecided_modes_is_not_drawn(sweep):
    unknown = sweep.assign(unstable=sweep["unstable"] * np.nan)
    ax = drawn(plots.growth_over_friction(unknown, [17, 18]))
    assert np.isnan(line(ax, "mode 18").get_ydata()).all()
    end = "never unstable where known: no lock-in up to friction 0.1"
    assert labels(ax) == ["mode 17", "mode 18", "undecided", end]
    axes = plots.dispersion(unknown)
    assert all(np.isnan(shown.get_ydata()).all() for shown in axes[0].lines[:18])
    assert plots.root_locus(unknown).collections[0].get_offsets().size == 0
    assert labels(drawn(plots.damping_over_frequency(unknown))) == ["undecided (18)"]
    drawn(plots.root_locus(unknown))
    drawn(plots.frequency_over_friction(unknown, [17, 18]))


def test_lock_in_panels(sweep):
    figure = Figure()
    axes = plots.lock_in(sweep, figure=figure)
    assert axes.shape == (2, 2)
    assert axes[0, 0].figure is figure
    assert [ax.get_title() for ax in axes[0]] == ["(a) modes 15 and 16", "(b) modes 17 and 18"]
    assert [ax.get_ylabel() for ax in axes[:, 0]] == ["frequency [Hz]", "growth rate [1/s]"]
    assert axes[1, 0].get_xlabel() == "friction coefficient [1]"
    assert plots.lock_in(sweep, [(11, 12)]).shape == (2, 1)
    # Beside other figures it matters where modes have these numbers.
    title = axes[1, 0].get_legend().get_title().get_text()
    where = float(plots.follow_modes(sweep)["reference_friction"])
    assert title == f"modes numbered by frequency at friction {where:.4g}"
    assert plots.dispersion(sweep)[-1].get_legend().get_title().get_text() == title
    assert not any("no lock-in" in label for ax in axes.flat for label in labels(ax))
    with pytest.raises(InputError, match="pairs are empty"):
        plots.lock_in(sweep, [])


def test_dispersion(sweep):
    axes = plots.dispersion(sweep)
    assert axes.shape == (3,)
    assert [ax.get_ylabel() for ax in axes] == ["growth rate [1/s]", "frequency [Hz]", "frequency [Hz]"]
    assert axes[-1].get_xlabel() == "friction coefficient [1]"
    assert [label for label in labels(axes[0]) if label.startswith("mode")] == [
        f"mode {mode}" for mode in (12, 14, 16, 18)
    ]
    frequency = np.array([shown.get_ydata() for shown in axes[1].lines])
    np.testing.assert_array_equal(np.sort(frequency, axis=0).T, sweep["frequency"])
    assert axes[2].get_title() == "modes 10 to 18 enlarged"
    given = Figure().subplots(2)
    assert list(plots.dispersion(sweep, axes=given)) == list(given)
    with pytest.raises(InputError, match="two or three"):
        plots.dispersion(sweep, axes=[Figure().subplots()])


# Eigenvalues in the plane


def test_root_locus_enlarges_the_cluster(sweep):
    ax = drawn(plots.root_locus(sweep))
    known = sweep["unstable"].notnull().values
    offsets = np.asarray(ax.collections[0].get_offsets())
    np.testing.assert_array_equal(offsets[:, 0], sweep["frequency"].values[known])
    np.testing.assert_array_equal(offsets[:, 1], sweep["growth_rate"].values[known])
    assert ax.get_title() == f"{(~known).sum()} undecided of {known.size} not drawn"
    assert ax.child_axes[0].get_title() == "modes 10-18 enlarged"
    assert ax.collections[0].colorbar.ax.get_ylabel() == "friction coefficient [1]"


def test_root_locus_draws_the_threshold():
    outcomes = sweep_of(hipuq.models.ring(CALIBRATED, growth_threshold=20.0), points=11)
    border = next(shown for shown in plots.root_locus(outcomes).lines if shown.get_linestyle() == "--")
    assert list(border.get_ydata()) == [20.0, 20.0]


def test_damping_takes_the_nearest_friction(sweep):
    ax = drawn(plots.damping_over_frequency(sweep, 0.08004))
    assert ax.get_title() == "friction coefficient 0.08"
    row = sweep.isel(sample=800)
    grows = row["unstable"].values == 1
    frequency, growth = row["frequency"].values[grows], row["growth_rate"].values[grows]
    shown = line(ax, "unstable")
    np.testing.assert_array_equal(shown.get_xdata(), frequency)
    np.testing.assert_allclose(shown.get_ydata(), -growth / np.hypot(2 * np.pi * frequency, growth))
    inset = [text.get_text() for text in ax.child_axes[0].texts]
    assert [number for number in inset if number in {"12", "14", "16", "18"}] == ["12", "14", "16", "18"]
    with pytest.raises(InputError, match="finite"):
        plots.damping_over_frequency(sweep, np.nan)


def test_damping_of_the_frictionless_ring_is_given(damped):
    ax = drawn(plots.damping_over_frequency(damped, 0.0))
    np.testing.assert_allclose(line(ax, "stable").get_ydata(), 0.02, rtol=1e-9)


def test_mechanisms_have_no_damping_ratio(mechanisms):
    rigid = int(mechanisms["mechanisms"][0])
    assert rigid == 2
    ax = drawn(plots.damping_over_frequency(mechanisms))
    assert f"no damping ratio: {rigid} rigid mechanisms" in labels(ax)
    assert (
        sum(len(shown.get_xdata()) for shown in ax.lines if shown.get_label() in {"stable", "unstable"}) == 16
    )
    assert ax.texts[0].get_text() == "3"
    for panel in plots.dispersion(mechanisms):
        drawn(panel)
    drawn(plots.root_locus(mechanisms))
    drawn(plots.lock_in(mechanisms, [(1, 2), (14, 15)])[0, 0])


def test_two_modes_make_no_cluster():
    outcomes = sweep_of(hipuq.models.two_dof("hoffmann2002"), 0.8)
    low, high = plots.lock_in_bracket(outcomes, 2)
    assert low < 0.472377492973330 < high
    assert plots.dispersion(outcomes).shape == (2,)
    assert not drawn(plots.root_locus(outcomes)).child_axes
    assert not drawn(plots.damping_over_frequency(outcomes)).child_axes


def test_damped_onset_is_not_called_lock_in():
    outcomes = sweep_of(hipuq.models.ring(CALIBRATED, damping_ratio=0.005), 0.2)
    mode = next(mode for mode in range(18, 0, -1) if np.isfinite(plots.lock_in_bracket(outcomes, mode)[1]))
    shown = [label for label in labels(plots.growth_over_friction(outcomes, [mode])) if "between" in label]
    assert len(shown) == 1 and f"mode {mode}: onset between" in shown[0]


def test_single_friction(sweep):
    one = sweep.isel(sample=[900])
    drawn(plots.lock_in(one)[0, 0])
    drawn(plots.dispersion(one)[0])
    drawn(plots.root_locus(one))
    drawn(plots.damping_over_frequency(one))
