"""Figures of methods beside each other: error, coverage and cost, read back from made-up results."""

import json
from itertools import pairwise

import numpy as np
import pytest
import xarray as xr
from drawing import assert_inside, drawn, labels, texts
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from hipuq import plots
from hipuq.errors import SchemaError, UnknownNameError
from hipuq.intervals import wilson

BUDGETS = np.array([64, 256, 1024])
NAMES = ["random", "latin hypercube", "Sobol sequence", "polynomial chaos"]
EVERY = [plots.error_over_cost, plots.coverage, plots.cost_of_accuracy]


def race(
    rmse=None, held=None, *, evaluations=None, reference=0.4, wide=0.0, seconds=None, ratio=None, **attrs
):
    """Return a comparison; methods are named in the order of `rmse`, by default all fall as n**-1/2."""
    rmse = np.outer([0.48, 0.3, 0.2, 0.1], BUDGETS**-0.5) if rmse is None else np.asarray(rmse, float)
    count = len(rmse)
    names = [*NAMES, *(f"method {i}" for i in range(len(NAMES), count))][:count]
    evaluations = np.tile(BUDGETS, (count, 1)) if evaluations is None else np.asarray(evaluations)
    out = evaluations == 0
    replicates = np.where(out, 0, 300)
    results = xr.Dataset(
        coords={"method": names, "budget": BUDGETS, "replicate": np.arange(1, 301)},
        attrs={
            "model": "two_dof(hoffmann2002)",
            "of": "any_unstable",
            "quantity": "probability",
            "baseline": "random",
            "confidence": 0.9,
            "title": "",
            "options": json.dumps({"compare": {"contenders": {name: {} for name in names}}}),
        }
        | attrs,
    )
    for name, text in (("method", "method"), ("budget", "budget of evaluations")):
        results[name].attrs.update(long_name=text, units="1")

    def put(name, values, text, dims=("method", "budget"), units="1"):
        results[name] = (dims, values, {"long_name": text, "units": units})

    rmse = np.where(out, np.nan, rmse)
    text = "root mean square error"
    for end, factor in (("", 1), ("_low", 0.9), ("_high", 1.2)):
        put(f"rmse{end}", factor * rmse, text + end.replace("_low", ", lower limit"))
    held = np.full(rmse.shape, 0.95) if held is None else np.asarray(held, float)
    held = np.where(out, np.nan, held)
    limits = wilson(np.nan_to_num(held) * 300, np.full(held.shape, 300.0), 0.9)
    for end, values in zip(("", "_low", "_high"), (held, *limits), strict=True):
        values = np.where(np.isnan(held), np.nan, values)
        put(f"coverage{end}", values, "share of intervals that hold the reference")
    put("evaluations", evaluations, "model evaluations")
    put("replicates", replicates, "replicates")
    mean = np.where(out, np.nan, 1e-4 * evaluations if seconds is None else seconds)
    # Their mean is the one given.
    spread = 1 + np.linspace(-0.1, 0.1, 300)
    put("run_time", mean, "median time of a run", ("method", "budget"), "s")
    put("seconds", mean[:, :, None] * spread, "time of a run", ("method", "budget", "replicate"), "s")
    for end, shift in (("", 0), ("_low", -wide), ("_high", wide)):
        put(f"reference{end}", reference + shift, "probability", ())
    first = np.where(rmse[0] == 0, np.nan, rmse[0])
    put("cost_ratio", (rmse / first) ** 2 if ratio is None else ratio, "cost")
    return results


def indices(**more):
    """Return a comparison of indices: errors by parameter, and over all."""
    results = race(quantity="ST", of="margin", **more)
    for name in ("rmse", "coverage"):
        for end in ("", "_low", "_high"):
            whole = results[f"{name}{end}"]
            factor = xr.DataArray([1.0, 0.5], dims="parameter", coords={"parameter": ["friction", "k3"]})
            results[f"{name}_overall{end}"] = whole
            results[f"{name}{end}"] = (whole * factor).assign_attrs(whole.attrs)
    return results


def methods(ax):
    """Return the lines of the methods by their label, less those that are in the legend alone."""
    return {
        line.get_label(): line
        for line in ax.lines
        if line.get_marker() in list("o^sDvPX*") and len(line.get_xdata())
    }


def bars(ax):
    """Return the ends of bars, (bars, 2), by colour."""
    return {
        tuple(part.get_color()[0][:3]): np.array([path[:, 1] for path in part.get_segments()])
        for part in ax.collections
    }


def slopes(ax):
    return [line for line in ax.lines if line.get_linestyle() == "--" and line.get_linewidth() < 1]


# Error


def test_error_over_evaluations():
    results = race()
    ax = drawn(plots.error_over_cost(results))
    assert labels(ax) == ["random (baseline)", *NAMES[1:]]
    for name, line in zip(NAMES, methods(ax).values(), strict=True):
        one = results.loc[{"method": name}]
        np.testing.assert_allclose(line.get_ydata(), one["rmse"])
        # Side by side, and near their number.
        np.testing.assert_allclose(line.get_xdata(), BUDGETS, rtol=0.05)
        low, high = bars(ax)[to_rgb(line.get_color())].T
        np.testing.assert_allclose(low, one["rmse_low"])
        np.testing.assert_allclose(high, one["rmse_high"])
    assert len({line.get_xdata()[0] for line in methods(ax).values()}) == 4
    assert ax.get_xscale() == ax.get_yscale() == "log"
    assert ax.get_xlabel() == "model evaluations [1]"
    assert ax.get_ylabel() == "root mean square error [1]"
    assert ax.get_title().split("\n") == [
        "any mode unstable: probability, two_dof(hoffmann2002)",
        "300 replicates, bars: 90 % interval",
    ]
    assert_inside(ax)


def test_error_over_time():
    seconds = np.outer([1e-3, 2e-3, 5e-3, 10], [1, 2, 8])
    ax = drawn(plots.error_over_cost(race(seconds=seconds), cost="seconds"))
    assert ax.get_xlabel() == "median time of a run [s]"
    for row, line in zip(seconds, methods(ax).values(), strict=True):
        np.testing.assert_allclose(line.get_xdata(), row)
    (slope,) = slopes(ax)
    (text,) = texts(ax)
    assert text == "$t^{-1/2}$"
    x, y = slope.get_data()
    np.testing.assert_allclose(np.diff(np.log(y)) / np.diff(np.log(x)), -0.5)
    # Through the largest run of the baseline: the time of a small one is not that of its evaluations.
    x0, y0 = next(iter(methods(ax).values())).get_xydata()[-1]
    np.testing.assert_allclose(y, y0 * (x / x0) ** -0.5)


def test_theoretical_slopes_go_through_the_first_point_of_the_baseline():
    ax = drawn(plots.error_over_cost(race(baseline="Sobol sequence")))
    x0, y0 = methods(ax)["Sobol sequence\n(baseline)"].get_xydata()[0]
    assert texts(ax) == ["$n^{-1/2}$", "$n^{-1}$"]
    for line, text, slope in zip(slopes(ax), ax.texts, (-0.5, -1.0), strict=True):
        x, y = line.get_data()
        np.testing.assert_allclose(y, y0 * (x / x0) ** slope)
        assert x[0] < x0 < x[1]
        # It is named where it ends, within the axis.
        np.testing.assert_allclose(text.xy, (x[1], y[1]))
        assert ax.get_ylim()[0] <= y[1] * (1 + 1e-9)


def test_a_baseline_without_a_point_leaves_the_slopes_to_another_method():
    for results in (race().isel(method=slice(1, None)), race([[0, 0, 0], [0.1, 0.05, 0.03]])):
        ax = drawn(plots.error_over_cost(results))
        first = methods(ax)["latin hypercube"].get_xydata()[0]
        x, y = slopes(ax)[0].get_data()
        assert np.interp(np.log(first[0]), np.log(x), np.log(y)) == pytest.approx(np.log(first[1]))


@pytest.mark.parametrize("cost", ["evaluations", "seconds"])
def test_methods_are_told_apart_by_marker_line_and_colour(cost):
    rmse = np.outer(np.linspace(1, 0.2, 8), BUDGETS**-0.5)
    lines = methods(drawn(plots.error_over_cost(race(rmse), cost=cost))).values()
    assert len(lines) == 8
    for what in ("marker", "color"):
        assert len({getattr(line, f"get_{what}")() for line in lines}) == 8
    assert len({str(line._dash_pattern) for line in lines}) == 8
    # Beyond that markers are open.
    more = methods(plots.error_over_cost(race(np.outer(np.ones(10), BUDGETS**-0.5)))).values()
    assert len({(line.get_marker(), line.get_markerfacecolor()) for line in more}) == 10


def test_a_method_looks_alike_in_all_figures():
    seen = [
        {name: (line.get_marker(), line.get_color()) for name, line in methods(figure(race())).items()}
        for figure in EVERY
    ]
    assert seen[0] == seen[1]
    assert seen[2] == {name: style for name, style in seen[0].items() if "baseline" not in name}


def test_errors_of_zero_are_named():
    rmse = [[0.06, 0.03, 0.015], [0, 0, 0], [0.04, 0, 0], [4e-17, 0, 2e-17]]
    ax = drawn(plots.error_over_cost(race(rmse)))
    assert [text.replace("\n", " ") for text in labels(ax)] == [
        "random (baseline)",
        "latin hypercube (exact: error 0)",
        "Sobol sequence (exact: error 0 at 256, 1,024)",
        "polynomial chaos (error 0 to rounding)",
    ]
    assert len(methods(ax)) == 2
    assert_inside(ax)


def test_rounding_is_by_the_size_of_the_reference():
    rmse = [[60, 30, 15], [4e-12, 2e-12, 1e-12]]
    found = [labels(plots.error_over_cost(race(rmse, reference=size)))[1] for size in (1e4, 1.0, 0.0)]
    assert found == ["latin hypercube\n(error 0 to rounding)", *["latin hypercube"] * 2]


def test_exactness_is_said_of_the_budgets_that_were_run():
    results = race([[0.06, 0.03, 0.015], [0, 0, 0]], evaluations=[BUDGETS, [64, 0, 0]])
    assert labels(plots.error_over_cost(results))[1] == "latin hypercube\n(exact: error 0)"


def test_only_errors_of_zero():
    ax = drawn(plots.error_over_cost(race(np.zeros((2, 3)))))
    assert texts(ax) == ["every error is 0: none on a logarithmic axis"]


def heights(ax, values):
    """Return where values lie by the height of the Axes."""
    x = np.full(len(values), 100.0)
    return (ax.transData.transform(np.column_stack([x, values]))[:, 1] - ax.bbox.y0) / ax.bbox.height


def test_an_axis_with_nothing_in_the_middle_is_broken():
    rmse = [[0.06, 0.03, 0.015], [0.04, 0.02, 0.01], [3e-13, 1e-13, 2e-13]]
    ax = drawn(plots.error_over_cost(race(rmse)))
    places = heights(ax, [1e-13, 3e-13, 0.01, 0.02, 0.06])
    assert (np.diff(places) > 0).all()
    assert 0 < places[0] < places[-1] < 1
    # Factors of two and three can be read, the eleven decades between take little room.
    assert places[3] - places[2] > 0.05
    assert places[4] - places[2] > 0.15
    assert places[1] - places[0] > 0.1
    assert np.diff(heights(ax, [1e-12, 1e-3])) < 0.2
    shown = [tick.get_text() for tick in ax.get_yticklabels()]
    assert {"$10^{-2}$", "$10^{-13}$"} <= set(shown)
    assert not {"$10^{-8}$", "$10^{-6}$"} & set(shown)
    # The break hides what leads across it, and the sides are marked at both of its ends.
    (hidden,) = ax.patches
    low, high = hidden.get_y(), hidden.get_y() + hidden.get_height()
    assert 3e-13 < low < high < 0.01
    (mark,) = (line for line in ax.lines if not isinstance(line.get_marker(), str))
    np.testing.assert_allclose(mark.get_ydata(), [low, low, high, high])
    # The slopes stay in the part of the baseline.
    assert all(line.get_ydata().min() >= high * (1 - 1e-9) for line in slopes(ax))
    assert_inside(ax)


def test_an_axis_is_broken_wherever_it_is_empty_and_only_there():
    three = drawn(plots.error_over_cost(race([[0.06, 0.03, 0.015], [4e-2, 1e-7, 1e-13]])))
    assert len(three.patches) == 2
    whole = plots.error_over_cost(race([[0.06, 0.03, 0.015], [4e-2, 1e-3, 3e-5]]))
    assert not whole.patches
    assert whole.get_yscale() == "log"


@pytest.mark.parametrize("spread", [1.0, 0.1, 1e-3, 1e-12])
def test_labels_of_the_error_do_not_overlap(spread):
    for width, height in ((6.4, 4.4), (4.0, 2.6)):
        ax = Figure(figsize=(width, height), layout="constrained").subplots()
        drawn(plots.error_over_cost(race([[0.06, 0.03, 0.015], [0.05 * spread] * 3]), ax=ax))
        low, high = ax.get_ylim()
        ticks = zip(ax.get_yticks(), ax.get_yticklabels(), strict=True)
        shown = [label for at, label in ticks if low <= at <= high and label.get_text()]
        assert len(shown) > 1
        boxes = sorted((label.get_window_extent() for label in shown), key=lambda box: box.y0)
        assert all(one.y1 < other.y0 + 2 for one, other in pairwise(boxes))


def test_the_standard_error_of_the_reference():
    ax = drawn(plots.error_over_cost(race(wide=0.0098)))
    (line,) = (line for line in ax.lines if line.get_label().startswith("standard"))
    np.testing.assert_allclose(line.get_ydata(), 0.005, rtol=1e-4)
    assert line.get_linestyle() == ":"
    assert labels(ax)[-1].replace("\n", " ") == "standard error of the reference: 0.005"
    assert ax.get_title().endswith("\nerrors below the dotted line cannot be told")
    assert_inside(ax)


def test_a_far_better_reference_takes_no_room():
    near, far = (plots.error_over_cost(race(wide=wide)) for wide in (0.0, 1e-7))
    assert far.get_ylim() == near.get_ylim()
    assert "reference: 5.1e-08" in labels(far)[-1]
    assert "dotted" not in far.get_title()
    assert not any("standard" in text for text in labels(near))


def test_gaps_of_methods_that_did_not_take_part():
    results = race(evaluations=[BUDGETS, [64, 0, 1000], [0, 0, 0], BUDGETS])
    results["rmse"][3] = np.nan
    ax = drawn(plots.error_over_cost(results))
    line = methods(ax)["latin hypercube"]
    assert np.isnan(line.get_ydata()).tolist() == [False, True, False]
    assert line.get_xdata()[2] == pytest.approx(1000, rel=0.02)
    assert [text.replace("\n", " ") for text in labels(ax)[2:]] == [
        "Sobol sequence (undefined)",
        "polynomial chaos (undefined)",
    ]


def test_bars_that_reach_zero_end_at_the_axis():
    results = race()
    results["rmse_low"][1] = 0.0
    ax = drawn(plots.error_over_cost(results))
    colour = to_rgb(methods(ax)["latin hypercube"].get_color())
    np.testing.assert_allclose(bars(ax)[colour][:, 0], ax.get_ylim()[0])
    assert ax.get_ylim()[0] > 1e-3


def test_indices_over_all_and_of_one_parameter():
    results = indices(wide=0.0)
    whole, one = drawn(plots.error_over_cost(results)), plots.error_over_cost(results, parameter="friction")
    half = plots.error_over_cost(results, parameter="k3")
    picked = plots.error_over_cost(results.sel(parameter="k3"))
    lines = [methods(ax)["latin hypercube"].get_ydata() for ax in (whole, one, half, picked)]
    np.testing.assert_allclose(lines[0], results["rmse_overall"][1])
    np.testing.assert_allclose(lines[1], lines[0])
    np.testing.assert_allclose(lines[2], lines[0] / 2)
    np.testing.assert_allclose(lines[3], lines[2])
    said = [ax.get_title().replace("\n", " ") for ax in (whole, one, picked)]
    assert ": ST over every parameter, two_dof" in said[0]
    assert ": ST of friction, two_dof" in said[1]
    assert ": ST of k3, two_dof" in said[2]
    assert ": ST over every parameter" in plots.cost_of_accuracy(results).get_title().replace("\n", " ")
    held = plots.coverage(results, parameter="k3")
    np.testing.assert_allclose(methods(held)["latin hypercube"].get_ydata(), 47.5)


def test_the_reference_of_indices_is_over_those_drawn():
    results = indices()
    for end, shift in (("", 0.0), ("_low", -1.0), ("_high", 1.0)):
        values = np.array([0.5, 0.2]) + shift * 1.959964 * np.array([0.03, 0.04])
        results[f"reference{end}"] = ("parameter", values)
    found = [labels(plots.error_over_cost(results, parameter=name))[-1] for name in (None, "friction")]
    assert found[0].endswith("0.035")
    assert found[1].endswith("0.03")


# Coverage


def test_coverage_in_percent_with_its_bars():
    held = [[0.95, 0.93, 0.96], [1.0, 0.99, 1.0], [0.7, 0.72, 0.71], [np.nan] * 3]
    results = race(held=held)
    ax = drawn(plots.coverage(results))
    assert ax.get_ylabel().replace("\n", " ") == "share of intervals that hold the reference [%]"
    assert ax.get_xscale() == "log"
    lines = methods(ax)
    for name, values in zip(("random (baseline)", *NAMES[1:3]), held, strict=False):
        np.testing.assert_allclose(lines[name].get_ydata(), np.multiply(100, values))
        low, high = bars(ax)[to_rgb(lines[name].get_color())].T
        one = results.loc[{"method": name.removesuffix(" (baseline)")}]
        np.testing.assert_allclose(low, 100 * one["coverage_low"])
        np.testing.assert_allclose(high, 100 * one["coverage_high"])
    places = [line.get_xdata()[0] for line in lines.values()]
    assert len(set(places)) == 3
    np.testing.assert_allclose(places, 64, rtol=0.1)
    assert labels(ax)[:2] == ["92 to 98 %", "stated level: 95 %"]
    assert labels(ax)[-1] == "polynomial chaos\n(no intervals)"
    low, high = ax.get_ylim()
    assert low < 65
    assert high > 100
    assert ax.get_title().split("\n")[1:] == [
        "300 replicates, bars: 90 % interval",
        "above the band: conservative, below: too narrow",
    ]
    assert_inside(ax)


def test_the_band_is_about_the_stated_level():
    ax = plots.coverage(race())
    (band,) = ax.patches
    assert (band.get_y(), band.get_y() + band.get_height()) == pytest.approx((92, 98))
    (line,) = (line for line in ax.lines if line.get_label() == "stated level: 95 %")
    assert set(line.get_ydata()) == {95.0}


def options(**levels):
    """Return options that state these levels."""
    contenders = {name: {"estimate": {"confidence": levels.get(name.split()[0])}} for name in NAMES}
    for entry in contenders.values():
        if entry["estimate"]["confidence"] is None:
            entry["estimate"] = {}
    return json.dumps({"compare": {"confidence": 0.9, "contenders": contenders}})


def test_levels_that_methods_state_come_from_their_options():
    same = plots.coverage(race(options=options(random=0.99, latin=0.99, Sobol=0.99, polynomial=0.99)))
    assert labels(same)[:2] == ["96 to 100 %", "stated level: 99 %"]
    one = drawn(plots.coverage(race(options=options(latin=0.8))))
    assert labels(one)[1] == "stated level: 95 %"
    assert "latin hypercube\n(states 80 %)" in labels(one)
    (own,) = (line for line in one.lines if set(line.get_ydata()) == {80.0})
    assert own.get_color() == methods(one)["latin hypercube\n(states 80 %)"].get_color()
    assert one.get_ylim()[0] < 80


def test_no_method_has_intervals():
    ax = drawn(plots.coverage(race(held=np.full((4, 3), np.nan))))
    assert texts(ax) == ["no method has intervals"]


# Cost


def test_cost_by_that_of_the_baseline():
    ratio = [[1, 1, 1], [0.5, 0.4, 0.3], [2, np.nan, 3], [1.1, 0.9, 0.7]]
    ax = drawn(plots.cost_of_accuracy(race(ratio=ratio)))
    for name, values in zip(NAMES[1:], ratio[1:], strict=True):
        np.testing.assert_allclose(methods(ax)[name].get_ydata(), values)
    assert labels(ax)[0] == "random (baseline): 1"
    assert set(ax.lines[0].get_ydata()) == {1}
    assert ax.get_yscale() == ax.get_xscale() == "log"
    assert ax.get_ylabel().replace("\n", " ") == "time by that of random for the same error [1]"
    assert ax.get_title().endswith("300 replicates\nabove 1: costs more than random, below: less")
    assert_inside(ax)


def test_ratios_that_have_no_place_are_named():
    ratio = [[1, 1, 1], [0, 0, 0], [0.5, 0.2, 1e-22], [np.inf, 2, 3]]
    ax = drawn(plots.cost_of_accuracy(race(ratio=ratio)))
    said = [text.replace("\n", " ") for text in labels(ax)]
    assert "latin hypercube (exact: ratio 0)" in said
    assert "polynomial chaos (infinite at 64)" in said
    assert ax.get_yscale() == "function"
    low, high = ax.get_ylim()
    assert low < 1e-22
    assert high > 1.3


def test_ratios_of_rounding_are_not_drawn():
    """Neither are its errors, and what is left out of one figure is left out of the other."""
    results = race([[0.06, 0.03, 0.015], [4e-17, 0, 2e-17]])
    ax = drawn(plots.cost_of_accuracy(results))
    assert labels(ax) == ["latin hypercube\n(ratio 0 to rounding)"]
    assert texts(ax) == ["every ratio is 0: none on a logarithmic axis"]
    assert not methods(ax)
    # Beside a baseline without an error there is no ratio.
    none = race(np.zeros((2, 3)), ratio=np.full((2, 3), np.nan))
    assert labels(plots.cost_of_accuracy(none)) == ["latin hypercube\n(undefined)"]


@pytest.mark.parametrize("value", [0.9, 1.1])
def test_the_line_is_always_shown(value):
    low, high = plots.cost_of_accuracy(race(ratio=np.full((4, 3), value))).get_ylim()
    assert low < 0.7
    assert high > 1.4


# All three


@pytest.mark.parametrize("figure", EVERY)
@pytest.mark.parametrize("size", [(6.4, 4.4), (5.0, 4.4)])
@pytest.mark.parametrize("count", [1, 2, 8])
def test_all_is_inside_and_labels_of_evaluations_do_not_overlap(figure, size, count):
    rmse = np.outer(np.linspace(1, 0.2, count), BUDGETS**-0.5)
    if count == 8:
        rmse[6], rmse[7] = 1e-13, 0.0
    ax = Figure(figsize=size, layout="constrained").subplots()
    results = race(rmse, wide=1e-3, title="A problem with a title that is long enough for more than one line")
    assert figure(results, ax=ax) is ax
    assert_inside(ax)
    assert ax.get_title().startswith("A problem with a title")
    left, right = ax.get_xlim()
    ticks = zip(ax.get_xticks(), ax.get_xticklabels(), strict=True)
    boxes = [label.get_window_extent() for at, label in ticks if left <= at <= right and label.get_text()]
    assert all(one.x1 < other.x0 for one, other in pairwise(boxes))
    # Most of the figure is left to the methods, even above a legend of eight.
    assert ax.bbox.height > 0.4 * ax.figure.bbox.height
    legend = ax.get_legend().get_window_extent()
    assert legend.x0 >= 0
    assert legend.x1 <= ax.figure.bbox.x1


@pytest.mark.parametrize("figure", EVERY)
def test_nothing_is_known(figure):
    results = race()
    for name in results.data_vars:
        if results[name].dtype.kind == "f":
            results[name][...] = np.nan
    ax = drawn(figure(results))
    assert len(texts(ax)) == 1
    results["evaluations"][...] = 0
    results["replicates"][...] = 0
    assert texts(drawn(figure(results))) == ["undefined"]


@pytest.mark.parametrize("figure", EVERY)
def test_replicates_that_differ(figure):
    results = race()
    results["replicates"][1] = 30
    assert "30 to 300 replicates" in figure(results).get_title()


@pytest.mark.parametrize(
    ("figure", "missing", "more"),
    [
        (plots.error_over_cost, "rmse", {}),
        (plots.error_over_cost, "rmse_low", {}),
        (plots.error_over_cost, "evaluations", {}),
        (plots.error_over_cost, "reference", {}),
        (plots.error_over_cost, "reference_high", {}),
        (plots.error_over_cost, "replicates", {}),
        (plots.error_over_cost, "run_time", {"cost": "seconds"}),
        (plots.error_over_cost, "rmse", {"parameter": "friction"}),
        (plots.coverage, "coverage", {}),
        (plots.coverage, "coverage_high", {}),
        (plots.cost_of_accuracy, "cost_ratio", {}),
        (plots.cost_of_accuracy, "rmse", {}),
    ],
)
def test_what_is_missing_is_named(figure, missing, more):
    with pytest.raises(SchemaError, match=f"needs '{missing}'.*results of hipuq.compare") as caught:
        figure(race().drop_vars(missing), **more)
    assert "\n" not in str(caught.value)


def test_what_is_asked_for_wrongly():
    with pytest.raises(UnknownNameError, match="did you mean 'seconds'"):
        plots.error_over_cost(race(), cost="second")
    with pytest.raises(UnknownNameError, match="did you mean 'friction'"):
        plots.error_over_cost(indices(), parameter="frction")
    with pytest.raises(SchemaError, match="rmse is not over parameter: leave out parameter='friction'"):
        plots.error_over_cost(race(), parameter="friction")
    with pytest.raises(SchemaError, match=r"rmse is over parameter too: select one.*'k3'"):
        plots.error_over_cost(indices().drop_vars("rmse_overall"))
    with pytest.raises(SchemaError, match="needs 'rmse' over"):
        plots.error_over_cost(race().isel(method=0))


def test_figures_leave_results_as_they_are():
    for results in (race(wide=0.01), indices()):
        before = results.copy(deep=True)
        for figure in EVERY:
            figure(results)
        xr.testing.assert_identical(results, before)
