"""Figures of the probability of instability: over a parameter, over two, by number in contact."""

from itertools import pairwise

import numpy as np
import pytest
import xarray as xr
from drawing import assert_inside, drawn, labels, texts
from matplotlib.collections import QuadMesh
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from plot_results import ANY, DAMPING, FALLING, literature, on_grid, over_two, patterns, swept

import hipuq
from hipuq import plots
from hipuq.errors import InputError, SchemaError, UnknownNameError

INCIDENCE = literature([0.027, 0.209, np.nan], [np.nan, np.nan, 0.05], [np.nan, np.nan, 0.06])


def hatches(ax):
    return [shown.get_hatch() for shown in [*ax.patches, *ax.collections] if shown.get_hatch()]


def band(shown):
    points = shown.get_paths()[0].vertices
    return {
        round(x, 9): (points[points[:, 0] == x, 1].min(), points[points[:, 0] == x, 1].max())
        for x in points[:, 0]
    }


# Over a parameter


def test_damping_is_in_per_cent_with_its_interval():
    ax = drawn(plots.probability_over(swept()))
    np.testing.assert_allclose(ax.lines[0].get_xdata(), 100 * DAMPING)
    np.testing.assert_allclose(ax.lines[0].get_ydata(), 100 * FALLING)
    assert band(ax.collections[0])[1.0] == pytest.approx((15, 35))
    assert ax.get_xlabel() == "modal damping ratio of the frictionless modes [%]"
    assert ax.get_ylabel() == "probability: any mode unstable [%]"
    assert labels(ax) == ["probability, 95 % interval"]
    assert_inside(ax)


def test_other_parameters_keep_their_unit_and_order_does_not_matter():
    results = swept(dim="friction", at=[0.2, 0.1, 0.0, 0.4, 0.3])
    before = results.copy(deep=True)
    ax = plots.probability_over(results)
    assert ax.get_xlabel() == "friction coefficient [1]"
    np.testing.assert_array_equal(ax.lines[0].get_xdata(), [0, 0.1, 0.2, 0.3, 0.4])
    np.testing.assert_allclose(ax.lines[0].get_ydata(), [25, 50, 90, 0, 5])
    assert results.identical(before)
    own = Figure().subplots()
    assert plots.probability_over(results, ax=own) is own


def test_stratified_results_are_drawn_overall():
    results = swept(overall=True)
    results["probability"] = (("damping_ratio", "pattern"), np.ones((5, 2)), ANY)
    ax = plots.probability_over(results)
    np.testing.assert_allclose(ax.lines[0].get_ydata(), 100 * FALLING)


def test_overlaid_results_are_told_apart_in_grey():
    ax = drawn(plots.probability_over({"a": swept(), "b": swept(FALLING / 2)}))
    # What bands are is said once.
    assert labels(ax) == ["a", "b", "bands: 95 % interval"]
    first, second = ax.lines
    assert first.get_color() != second.get_color()
    exact = swept(confidence=1.0)
    ends = ["95 % interval", "limits of the unknown"]
    assert labels(plots.probability_over({"a": swept(), "b": exact})) == [f"a, {ends[0]}", f"b, {ends[1]}"]


def test_neighbouring_curves_differ_in_all_that_grey_print_shows():
    curves = {str(i): swept(FALLING / (1 + i)) for i in range(6)}
    lines = drawn(plots.probability_over(curves)).lines
    grey = [np.dot(to_rgb(line.get_color()), (0.299, 0.587, 0.114)) for line in lines]
    for i, (one, other) in enumerate(pairwise(lines)):
        assert abs(grey[i] - grey[i + 1]) > 0.1
        assert abs(one.get_linewidth() - other.get_linewidth()) > 1
        assert (one.get_markerfacecolor() == "white") != (other.get_markerfacecolor() == "white")
    assert len({line.get_marker() for line in lines}) == 6
    assert len({str(line._dash_pattern) for line in lines}) == 6


def test_incidence_is_a_hatched_band_of_another_quantity():
    ax = drawn(plots.probability_over(swept(0.1 * FALLING, 0.01), literature=INCIDENCE))
    shown = ax.patches[0]
    assert shown.get_y() == pytest.approx(2.7)
    assert shown.get_y() + shown.get_height() == pytest.approx(20.9)
    assert shown.get_hatch()
    assert labels(ax)[0] == "incidence reported in patients: 2.7 to 20.9 % (another quantity)"
    low, high = ax.get_ylim()
    assert low < 0 and 20.9 < high < 30
    assert_inside(ax)


def test_unknown_probabilities_are_gaps_with_a_mark():
    ax = drawn(plots.probability_over(swept([0.9, np.nan, 0.5, 0.2, 0.1])))
    np.testing.assert_array_equal(np.isnan(ax.lines[0].get_ydata()), [False, True, False, False, False])
    assert [(text.get_text(), text.xy[0]) for text in ax.texts] == [("?", 0.5)]
    assert band(ax.collections[0])[0.5] == pytest.approx((0, 100))
    nothing = drawn(plots.probability_over(swept([np.nan] * 5)))
    assert texts(nothing) == ["?"] * 5


def test_no_limits_no_interval():
    exact = swept(width=0.0, confidence=1.0)
    assert labels(plots.probability_over(exact)) == ["probability"]
    assert labels(plots.probability_over(swept(confidence=1.0))) == ["probability, limits of the unknown"]
    bare = exact[["probability"]]
    assert labels(drawn(plots.probability_over(bare))) == ["probability"]


def test_logarithmic_scale_points_down_from_the_limit_of_zero():
    ax = drawn(plots.probability_over(swept(width=0.02), scale="log", literature=INCIDENCE))
    assert ax.get_yscale() == "log"
    bottom, top = ax.get_ylim()
    assert bottom == pytest.approx(1) and top > 100
    assert np.isnan(ax.lines[0].get_ydata()[-1])
    arrow = next(shown for shown in ax.collections if "arrow" in shown.get_label())
    np.testing.assert_allclose(arrow.get_offsets(), [(2.0, 2.0)])
    assert (np.asarray(list(band(ax.collections[0]).values())) >= bottom * 0.999).all()
    drawn(plots.probability_over(swept(0 * FALLING, 0.0), scale="log"))


def test_a_sweep_is_drawn_as_it_comes():
    import chaospy as cp

    model = hipuq.models.two_dof("hoffmann2002")
    over = {"k1": [8.0, 11.0]}
    results = hipuq.sweep(
        model,
        model.inputs(friction=cp.Uniform(0.0, 0.8)),
        over,
        method="monte_carlo",
        n=20,
        of="any_unstable",
        rng=1,
        progress=False,
    )
    ax = drawn(plots.probability_over(results))
    np.testing.assert_array_equal(ax.lines[0].get_xdata(), over["k1"])
    np.testing.assert_allclose(ax.lines[0].get_ydata(), 100 * results["probability"])
    assert ax.get_xlabel().endswith("[N/m]")


def test_probability_over_refuses():
    two = over_two(np.full((3, 4), 0.5)).assign_attrs(over='["damping_ratio", "friction"]')
    with pytest.raises(SchemaError, match="name one as dim and select the others"):
        plots.probability_over(two)
    with pytest.raises(SchemaError, match=r"over friction too: select one, such as results\.sel\(friction=0"):
        plots.probability_over(two, dim="damping_ratio")
    with pytest.raises(SchemaError, match="it over friction"):
        plots.probability_over(swept(), dim="friction")
    with pytest.raises(SchemaError, match="is a single number"):
        plots.probability_over(swept().isel(damping_ratio=0))
    with pytest.raises(SchemaError, match="'probability' over a parameter"):
        plots.probability_over(swept().drop_vars("probability"))
    with pytest.raises(SchemaError, match="over damping_ratio and friction"):
        plots.probability_over({"a": swept(), "b": swept(dim="friction")})
    with pytest.raises(SchemaError, match="not finite"):
        plots.probability_over(swept(at=[0, 1, 2, 3, np.nan]))
    with pytest.raises(SchemaError, match="not dict"):
        plots.probability_over({"a": {}})
    with pytest.raises(InputError, match="results are empty"):
        plots.probability_over({})
    with pytest.raises(UnknownNameError, match="scale"):
        plots.probability_over(swept(), scale="logit")
    with pytest.raises(SchemaError, match="literature needs 'value' over"):
        plots.probability_over(swept(), literature=swept())
    with pytest.raises(SchemaError, match="literature has no finite value"):
        plots.probability_over(swept(), literature=literature(np.nan))


# By number in contact


def test_by_count_shows_mean_interval_and_range():
    results = patterns()
    ax = drawn(plots.by_count(results, exact=results))
    mean = ax.containers[0].lines[0]
    np.testing.assert_allclose(mean.get_ydata(), 100 * results["probability_mean"])
    ends = np.array([part[:, 1] for part in ax.containers[0].lines[2][0].get_segments()])
    np.testing.assert_allclose(ends[:, 0], 100 * results["probability_mean_low"])
    bars = np.array([part[:, 1] for part in ax.collections[0].get_segments()])
    np.testing.assert_allclose(bars[:, 0], 100 * results["probability_min"][:-1])
    np.testing.assert_allclose(bars[:, 1], 100 * results["probability_max"][:-1])
    assert [text.get_text() for text in ax.get_xticklabels()] == ["2\n(6)", "3\n(4)", "4\n(1)"]
    assert ax.get_ylabel() == "probability: any mode unstable [%]"
    assert {"mean, 95 % interval", "exact", "range over the patterns"} <= set(labels(ax))
    assert_inside(ax)
    assert ax.get_legend().get_window_extent().y1 < ax.xaxis.label.get_window_extent().y0
    assert ax.get_ylim() == pytest.approx((-4, 104))
    small = plots.by_count(0.5 * results.drop_vars("contact"), exact=0.6 * results.drop_vars("contact"))
    assert small.get_ylim()[1] == pytest.approx(1.1 * 60 * float(results["probability_max"].max()))


def test_by_count_marks_what_is_unknown_and_refuses():
    results = patterns()
    results["probability_mean"][1] = np.nan
    ax = drawn(plots.by_count(results))
    assert texts(ax) == ["?"]
    with pytest.raises(SchemaError, match="'probability_min' over"):
        plots.by_count(results.drop_vars("probability_min"))
    with pytest.raises(SchemaError, match="select one, such as"):
        plots.by_count(results.expand_dims(damping_ratio=[0.0, 0.1]))
    with pytest.raises(InputError, match="count of the exact results"):
        plots.by_count(results, exact=results.isel(count=[0, 1]))


# Over two parameters

STEEP = np.array([[0.0, 0.2, 0.9, 1.0], [0.0, 0.1, 0.4, 0.9], [0.0, 0.0, 0.1, 0.6]])
VERDICTS = np.array([[0, 1, 1, 1], [0, 0, np.nan, 1], [0, 0, 0, np.nan]])


def mesh(ax):
    return next(shown for shown in ax.collections if isinstance(shown, QuadMesh))


def cells(ax):
    """Return the edges of cells, and their values read back from the colours."""
    shown = mesh(ax)
    corners = shown.get_coordinates()
    return corners[0, :, 0], corners[:, 0, 1], np.ma.filled(shown.get_array().astype(float), np.nan)


def test_map_of_a_sweep_over_two_parameters():
    ax = drawn(plots.stability_map(over_two(STEEP), "friction", "damping_ratio"))
    x, y, values = cells(ax)
    # Halfway between values, and none beyond the outermost.
    np.testing.assert_allclose(x, [0, 0.1 / 6, 0.05, 0.5 / 6, 0.1])
    np.testing.assert_allclose(y, [0, 0.25, 0.75, 1])
    assert ax.get_xlim() == pytest.approx((0, 0.1)) and ax.get_ylim() == pytest.approx((0, 1))
    np.testing.assert_allclose(values, 100 * STEEP)
    assert mesh(ax).norm.vmin == 0 and mesh(ax).norm.vmax == 100
    assert ax.get_xlabel() == "friction coefficient [1]"
    assert ax.get_ylabel().replace("\n", " ") == "modal damping ratio of the frictionless modes [%]"
    assert ax.figure.axes[1].get_ylabel() == "probability: any mode unstable [%]"
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["probability 50 %"]
    turned = plots.stability_map(over_two(STEEP), "damping_ratio", "friction")
    np.testing.assert_allclose(cells(turned)[2], 100 * STEEP.T)
    assert_inside(ax)


def test_map_of_probabilities_that_nowhere_reach_a_half():
    ax = drawn(plots.stability_map(over_two(0.04 * STEEP), "friction", "damping_ratio"))
    assert ax.get_legend() is None
    assert mesh(ax).norm.vmax == pytest.approx(5)


def test_map_of_verdicts_has_three_classes():
    ax = drawn(plots.stability_map(on_grid(VERDICTS), "friction", "damping_ratio"))
    np.testing.assert_array_equal(cells(ax)[2], VERDICTS)
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    assert legend == ["stable", "unstable", "unknown (2 of 12)"]
    assert len(set(hatches(ax))) == 2
    border = next(
        shown for shown in ax.collections if shown.get_label().startswith("_") and "LineC" in str(shown)
    )
    # Sides between a stable and an unstable cell; none touches an unknown one.
    assert len(border.get_segments()) == 2
    assert_inside(ax)


def test_map_of_margins_and_growth_rates():
    margin = 0.05 - np.add.outer(np.zeros(3), np.linspace(0, 0.1, 4))
    data = on_grid(margin, "margin", long_name="stability margin", units="1")
    ax = drawn(plots.stability_map(data, "friction", "damping_ratio"))
    np.testing.assert_allclose(cells(ax)[2], margin)
    assert ax.figure.axes[1].get_ylabel() == "stability margin [1]"
    line = next(shown for shown in ax.collections if hasattr(shown, "levels"))
    np.testing.assert_allclose(line.get_paths()[0].vertices[:, 0], 0.05)
    growth = on_grid(margin).drop_vars("any_unstable")
    values = np.stack([on_grid(-margin, "g")["g"].values, np.full(12, -1.0)], axis=1)
    verdict = np.zeros((12, 2))
    verdict[3, 1] = np.nan
    growth["growth_rate"] = (("sample", "mode"), values, {"long_name": "growth rate", "units": "1/s"})
    growth["unstable"] = (("sample", "mode"), verdict)
    ax = drawn(plots.stability_map(growth, "friction", "damping_ratio", of="growth_rate"))
    assert np.isnan(cells(ax)[2]).sum() == 1
    np.testing.assert_allclose(np.nanmax(cells(ax)[2]), 0.05)
    assert ax.figure.axes[1].get_ylabel() == "largest growth rate [1/s]"


@pytest.mark.parametrize("value", [0.0, 1.0, np.nan])
def test_map_of_one_value(value):
    drawn(plots.stability_map(on_grid(np.full((2, 2), value)), "friction", "damping_ratio"))
    drawn(plots.stability_map(over_two(np.full((2, 2), value)), "friction", "damping_ratio"))
    drawn(plots.stability_map(on_grid(np.full((2, 2), value), "margin"), "friction", "damping_ratio"))


def test_stability_map_refuses():
    data = on_grid(VERDICTS)
    x, y = "friction", "damping_ratio"
    with pytest.raises(
        SchemaError, match=r"no full grid of 4 friction by 3 damping_ratio: .* is missing; 1 of 12"
    ):
        plots.stability_map(data.isel(sample=slice(1, None)), x, y)
    with pytest.raises(SchemaError, match="comes 2 times"):
        plots.stability_map(data.isel(sample=[0, *range(12)]), x, y)
    with pytest.raises(SchemaError, match="'mass' over sample"):
        plots.stability_map(data, x, "mass")
    with pytest.raises(SchemaError, match="'margin': keep it"):
        plots.stability_map(data, x, y, of="margin")
    with pytest.raises(UnknownNameError, match="onset"):
        plots.stability_map(data, x, y, of="onset")
    with pytest.raises(InputError, match="two parameters"):
        plots.stability_map(data, x, x)
    with pytest.raises(InputError, match="two or more"):
        plots.stability_map(on_grid(VERDICTS[:1]), x, y)
    with pytest.raises(InputError, match="mass_damping varies"):
        plots.stability_map(data.assign(mass_damping=("sample", np.arange(12.0))), x, y)
    with pytest.raises(InputError, match="results of a sweep have 'probability'"):
        plots.stability_map(over_two(STEEP), x, y, of="margin")
    with pytest.raises(SchemaError, match="'probability' over"):
        plots.stability_map(xr.Dataset({"friction": 1.0}), x, y)


def test_dollars_in_names_are_no_mathematics(tmp_path):
    curve = swept(FALLING)
    ax = plots.probability_over({"$\\frac{$": curve, "b": curve})
    ax.figure.savefig(tmp_path / "a.png")
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert any("frac" in name for name in names)


@pytest.mark.parametrize("quantity", ["critical_friction", "squeak_frequency"])
def test_other_published_figures_are_no_incidence(quantity):
    with pytest.raises(SchemaError, match=f"is of '{quantity}': it must be of 'incidence'"):
        plots.probability_over(swept(FALLING), literature=hipuq.literature(quantity))


@pytest.mark.parametrize(
    "draw",
    [
        lambda: plots.probability_over(None),
        lambda: plots.probability_over({"a": 1}),
        lambda: plots.boxplots(None),
        lambda: plots.by_count([]),
        lambda: plots.pattern_map(3),
        lambda: plots.mode_frequencies(None),
        lambda: plots.stability_map(None, "x", "y"),
        lambda: plots.onset_distribution(None),
        lambda: plots.fragility(None),
        lambda: plots.probability_over(swept(FALLING), literature=3),
    ],
)
def test_what_is_no_dataset_is_told(draw):
    with pytest.raises(SchemaError, match=r"must be a"):
        draw()
