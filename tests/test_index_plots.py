"""Figures of indices, of convergence and of a surrogate against the truth."""

import warnings
from itertools import pairwise

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
from index_results import ELEMENTS, NAMES, OUTCOME, REASON, by_mode, chaos, sobol, variable
from matplotlib.figure import Figure

from hipuq import plots
from hipuq.errors import InputError, SchemaError, UnknownNameError
from hipuq.plots.captions import parameter_label

NAN = [np.nan] * 6
FIGURES = {
    "index_bars": plots.index_bars,
    "second_order": plots.second_order,
    "convergence": plots.convergence,
    "predicted_against_true": plots.predicted_against_true,
}


def made(name):
    return chaos() if name == "predicted_against_true" else sobol()


def drawn(ax):
    """Draw the whole figure, which runs the layout: a warning there is an error here."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ax.figure.draw_without_rendering()
    return ax


def labels(ax):
    return ax.get_legend_handles_labels()[1]


def texts(ax):
    return [text.get_text() for text in ax.texts]


def bars(ax, order):
    """Return the lengths of the bars of one order, from top to bottom."""
    container = next(one for one in ax.containers if one.get_label().startswith(order))
    return [bar.get_width() for bar in container]


def assert_inside(ax):
    """Assert that nothing that is written reaches beyond the figure."""
    box, page = drawn(ax).get_tightbbox(), ax.figure.bbox
    assert page.x0 - 1 <= box.x0
    assert box.x1 <= page.x1 + 1
    assert page.y0 - 1 <= box.y0
    assert box.y1 <= page.y1 + 1


def elements(count=40, width=0.01):
    total = np.linspace(0.3, 0.0, count)
    return sobol(ELEMENTS[:count], total / 3 - 0.004, total, width=width)


# Every figure


@pytest.mark.parametrize("name", FIGURES)
def test_axes_given_are_used_and_nothing_else_is_changed(name):
    results = made(name)
    before, style = results.copy(deep=True), dict(mpl.rcParams)
    ax = Figure(layout="constrained").subplots()
    assert FIGURES[name](results, ax=ax) is ax
    assert drawn(FIGURES[name](results)).figure is not ax.figure
    assert results.identical(before)
    assert dict(mpl.rcParams) == style


@pytest.mark.parametrize("name", FIGURES)
def test_everything_written_is_inside(name):
    assert_inside(FIGURES[name](made(name)))


@pytest.mark.parametrize("name", FIGURES)
def test_modes_have_to_be_selected(name):
    results = by_mode(made(name))
    with pytest.raises(SchemaError, match=r"is over mode too: select one, such as results\.sel\(mode=18\)"):
        FIGURES[name](results)
    ax = drawn(FIGURES[name](results.sel(mode=17)))
    assert "mode 17" in ax.get_title()


@pytest.mark.parametrize(
    ("name", "gone", "needed"),
    [
        ("index_bars", ["S1"], "'S1' over"),
        ("second_order", ["S2"], r"'S2' over \(parameter, parameter_2\).*with second order"),
        ("convergence", ["S1_by_budget", "ST_by_budget"], "ends in '_by_budget'"),
        ("predicted_against_true", ["predicted"], "'predicted' over"),
    ],
)
def test_what_is_missing_is_named(name, gone, needed):
    keep = [key for key in made(name).data_vars if not any(str(key).startswith(part) for part in gone)]
    with pytest.raises(SchemaError, match=needed):
        FIGURES[name](made(name)[keep])


# Bars


def test_bars_are_sorted_by_the_total_index():
    ax = drawn(plots.index_bars(sobol()))
    names = ["friction", "contact", "spring stiffness", "spring angle", "contact stiffness", "contact angle"]
    assert [tick.get_text() for tick in ax.get_yticklabels()] == names
    np.testing.assert_allclose(bars(ax, "first"), [0.47, 0.03, 0.02, 0.004, -0.012, 0.0])
    np.testing.assert_allclose(bars(ax, "total"), [0.84, 0.50, 0.47, 0.33, 0.33, 0.02])
    assert ax.yaxis_inverted()
    assert ax.get_title() == OUTCOME
    assert ax.get_xlabel() == "Sobol index: share of the variance [1]"
    assert labels(ax) == ["95 % interval", "first order (alone)", "total order (with interactions)"]


def test_limits_are_drawn_as_they_are():
    """A percentile interval that does not hold its estimate is not bent to do so."""
    results = sobol()
    results["S1_low"][0], results["S1_high"][0] = 0.5, 0.6
    ax = plots.index_bars(results)
    first, total = (part.get_segments() for part in ax.collections)
    assert first[0][:, 0].tolist() == [0.5, 0.6]
    np.testing.assert_allclose(total[0][:, 0], [0.81, 0.87])
    # On the height of their bars.
    tops = [container[0] for container in ax.containers]
    for whiskers, bar in zip((first, total), tops, strict=True):
        assert whiskers[0][0, 1] == pytest.approx(bar.get_y() + bar.get_height() / 2)


def test_without_limits_there_are_none():
    ax = drawn(plots.index_bars(chaos()))
    assert not ax.collections
    assert labels(ax) == ["first order (alone)", "total order (with interactions)"]


def test_undefined_indices_say_so_and_have_no_bar():
    first = [0.47, np.nan, 0.02, -0.05, 0.004, np.nan]
    total = [0.84, 0.5, 0.47, 0.33, np.nan, np.nan]
    ax = drawn(plots.index_bars(sobol(first=first, total=total)))
    assert len(bars(ax, "first")) == len(bars(ax, "total")) == 4
    # One index missing of two parameters, both of one.
    assert texts(ax) == ["undefined"] * 3
    assert sorted(text.xy[1] % 1 for text in ax.texts) == pytest.approx([0.0, 0.18, 0.82])
    assert REASON in ax.get_title()


def test_all_undefined():
    ax = drawn(plots.index_bars(sobol(first=NAN, total=NAN)))
    assert not ax.containers
    assert texts(ax) == ["undefined"] * 6
    assert ax.get_legend() is None
    assert ax.get_xlim() == (0, 1)
    assert REASON in ax.get_title()


def test_parameters_asked_for():
    ax = plots.index_bars(sobol(), parameters=["contact_angle", "friction"])
    np.testing.assert_allclose(bars(ax, "total"), [0.02, 0.84])
    with pytest.raises(UnknownNameError, match="did you mean 'friction'"):
        plots.index_bars(sobol(), parameters=["fricton"])
    with pytest.raises(InputError, match="parameters is empty"):
        plots.index_bars(sobol(), parameters=[])


@pytest.mark.parametrize("count", [1, 2, 40])
def test_few_and_many_parameters(count):
    ax = plots.index_bars(elements(count))
    assert_inside(ax)
    ticks = [tick.get_window_extent() for tick in ax.get_yticklabels()]
    assert len(ticks) == count
    assert all(below.y1 <= above.y0 + 1 for above, below in pairwise(ticks))


def test_many_parameters_fit_into_axes_given():
    ax = Figure(figsize=(4, 5), layout="constrained").subplots()
    plots.index_bars(elements(), ax=ax)
    assert_inside(ax)
    ticks = [tick.get_window_extent() for tick in ax.get_yticklabels()]
    assert all(below.y1 <= above.y0 + 2 for above, below in pairwise(ticks))


@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("friction", "friction"),
        ("spring_stiffness", "spring stiffness"),
        ("spring_stiffness[12]", "spring stiffness 12"),
        ("E_cup", "E_cup"),
        ("E_cup[2]", "E_cup[2]"),
        ("a$b$c", "a$b$c"),
    ],
)
def test_names_of_parameters(name, label):
    assert parameter_label(name) == label
    ax = drawn(plots.index_bars(sobol([name], [0.9], [1.0])))
    assert ax.get_yticklabels()[0].get_text() == label


# Heat map


def test_each_pair_is_shown_once():
    results = sobol()
    ax = plots.second_order(results)
    assert_inside(ax)
    assert len(ax.patches) == len(ax.texts) == 15
    rows = [tick.get_text() for tick in ax.get_yticklabels()]
    columns = [tick.get_text() for tick in ax.get_xticklabels()]
    assert rows == [parameter_label(name) for name in NAMES[1:]]
    assert columns == [parameter_label(name) for name in NAMES[:-1]]
    at = {text.get_position(): text.get_text() for text in ax.texts}
    value = float(results["S2"].sel(parameter="contact_stiffness", parameter_2="contact"))
    assert ax.get_title().endswith("beneath: 95 % interval")
    assert at[1, 2].split("\n") == [f"{value:.2f}", f"{value - 0.03:.2f} to", f"{value + 0.03:.2f}"]


def test_colours_are_by_value_and_grey_print_keeps_their_order():
    results = chaos()
    results["S2"][:] = np.nan
    for i, value in ((1, -0.02), (2, 0.0), (3, 0.1), (4, 0.2), (5, 0.4)):
        results["S2"][0, i] = results["S2"][i, 0] = value
    ax = drawn(plots.second_order(results))
    shown = [
        patch for patch, text in zip(ax.patches, ax.texts, strict=True) if text.get_text() != "undefined"
    ]
    grey = [np.dot(patch.get_facecolor()[:3], (0.299, 0.587, 0.114)) for patch in shown]
    assert grey[0] == grey[1] > 0.9
    assert grey[1] > grey[2] > grey[3] > grey[4]
    assert next(text for text in texts(ax) if text != "undefined") == "-0.02"
    assert texts(ax).count("undefined") == 10
    assert "beneath" not in ax.get_title()


def test_a_rounded_zero_has_no_sign():
    results = chaos(NAMES[:2], [0.5, 0.2], [0.8, 0.5])
    results["S2"][:] = -0.0001
    assert texts(plots.second_order(results)) == ["0.00"]
    results["S2"][:] = 0.0123
    assert texts(plots.second_order(results)) == ["0.012"]


def test_all_pairs_undefined():
    ax = drawn(plots.second_order(sobol(first=NAN, total=NAN)))
    assert texts(ax) == ["undefined"] * 15
    assert REASON in ax.get_title().replace("\n", " ")


def test_one_parameter_has_no_pairs():
    ax = drawn(plots.second_order(sobol(["friction"], [0.9], [1.0])))
    assert texts(ax) == ["no pairs: friction is the only parameter"]


def test_many_pairs_have_numbers_that_fit_their_cells():
    ax = plots.second_order(elements())
    assert_inside(ax)
    assert len(ax.texts) == 780
    width = ax.patches[0].get_window_extent().width
    assert max(text.get_window_extent().width for text in ax.texts) <= width


# Convergence


def settling(budget=(500, 1000, 2000), values=(0.5, 0.6, 0.58), width=0.05):
    said = {"long_name": "evaluations", "units": "1"}
    results = xr.Dataset(coords={"budget": ("budget", list(budget), said)}, attrs={"confidence": 0.9})
    for end, shift in (("", 0), ("_low", -width), ("_high", width)):
        text = "probability: any mode unstable, by evaluations"
        variable(results, f"probability_by_budget{end}", ("budget",), np.add(values, shift), text)
    return results


def test_probability_settles_in_percent_with_its_band():
    results = settling()
    variable(results, "probability", (), 0.58, "probability: any mode unstable")
    ax = drawn(plots.convergence(results))
    np.testing.assert_allclose(ax.lines[0].get_xydata(), [(500, 50), (1000, 60), (2000, 58)])
    edge = ax.collections[0].get_paths()[0].vertices
    assert edge[edge[:, 0] == 1000, 1].min() == pytest.approx(55)
    assert edge[edge[:, 0] == 1000, 1].max() == pytest.approx(65)
    assert ax.get_xscale() == "log"
    assert ax.get_xlabel() == "evaluations [1]"
    assert ax.get_ylabel() == "probability: any mode unstable [%]"
    assert labels(ax) == ["probability, 90 % interval"]
    assert_inside(ax)


def test_designs_share_axes():
    ax = plots.convergence(settling(), label="plain")
    assert plots.convergence(settling(budget=(5000, 10000, 20000)), ax=ax, label="Sobol") is ax
    assert labels(drawn(ax)) == ["plain, 90 % interval", "Sobol, 90 % interval"]
    one, other = ax.lines
    assert one.get_linestyle() != other.get_linestyle()
    assert one.get_marker() != other.get_marker()
    left, right = ax.get_xlim()
    assert left < 500
    assert right > 20000


@pytest.mark.parametrize(
    ("budget", "shown"),
    [
        ((1500,), {"1,500"}),
        ((300, 3000), {"500", "1,000", "2,000"}),
        ((100, 10**7), {"100", "1,000", "10,000", "100,000", "1,000,000", "10,000,000"}),
    ],
)
def test_evaluations_are_plain_numbers_that_do_not_overlap(budget, shown):
    ax = drawn(plots.convergence(settling(budget, [0.5] * len(budget))))
    left, right = ax.get_xlim()
    ticks = [
        label
        for at, label in zip(ax.get_xticks(), ax.get_xticklabels(), strict=True)
        if left <= at <= right and label.get_text()
    ]
    assert {tick.get_text() for tick in ticks} >= shown
    boxes = [tick.get_window_extent() for tick in ticks]
    assert all(one.x1 < other.x0 for one, other in pairwise(boxes))


def test_indices_settle_by_parameter():
    results = sobol()
    ax = drawn(plots.convergence(results))
    assert ax.get_ylabel().replace("\n", " ") == f"total-order index of {OUTCOME} [1]"
    assert labels(ax)[:2] == ["friction", "contact"]
    np.testing.assert_allclose(ax.lines[0].get_ydata(), results["ST_by_budget"].sel(parameter="friction"))
    bars_of = ax.collections[0].get_segments()
    np.testing.assert_allclose([bar[0, 1] for bar in bars_of], results["ST_by_budget_low"][:, 0])
    np.testing.assert_allclose([bar[1, 1] for bar in bars_of], results["ST_by_budget_high"][:, 0])
    # Side by side, and near their budget.
    places = np.array([line.get_xdata()[0] for line in ax.lines[:6]])
    assert len(set(places)) == 6
    assert np.abs(places / 1792 - 1).max() < 0.1
    assert ax.get_title() == "bars: 95 % interval"


def test_a_parameter_has_the_same_style_for_both_orders():
    first, total = (plots.convergence(sobol(), quantity=name) for name in ("S1", "ST"))
    assert labels(first) == labels(total)
    assert [line.get_color() for line in first.lines] == [line.get_color() for line in total.lines]
    assert first.get_ylabel().startswith("first-order")


def test_many_parameters_are_grey_but_the_largest():
    ax = plots.convergence(elements())
    assert_inside(ax)
    assert len(labels(ax)) == 7
    assert labels(ax)[-1] == "34 others"


def test_a_quantity_that_is_not_there():
    with pytest.raises(UnknownNameError, match="did you mean 'probability'"):
        plots.convergence(settling(), quantity="probabilty")
    with pytest.raises(SchemaError, match="needs numbers above 0"):
        plots.convergence(settling(budget=(0, 10, 20)))


def test_undefined_at_first():
    results = settling(values=(np.nan, np.nan, 0.58))
    ax = drawn(plots.convergence(results))
    assert ax.get_title() == "undefined below 2,000 evaluations"
    assert np.isnan(ax.lines[0].get_ydata()).tolist() == [True, True, False]


def test_undefined_throughout():
    ax = drawn(plots.convergence(sobol(first=NAN, total=NAN)))
    assert texts(ax) == [f"undefined: {REASON}"]
    assert not ax.lines
    assert not ax.collections
    assert ax.get_legend() is None
    one = sobol(first=[np.nan, *[0.1] * 5], total=[np.nan, *[0.2] * 5])
    assert "friction: undefined" in labels(drawn(plots.convergence(one)))


# Surrogate against the truth


def points(ax):
    """Return the offsets of the points that agree, and of those that do not."""
    return [np.asarray(part.get_offsets()) for part in ax.collections]


def test_points_on_the_wrong_side_are_in_the_shaded_quadrants():
    results = chaos()
    true, predicted = results["true"].values, results["predicted"].values
    ax = drawn(plots.predicted_against_true(results))
    right, wrong = points(ax)
    assert len(right) + len(wrong) == 600
    assert len(wrong) == ((true < 0) != (predicted < 0)).sum() > 0
    assert (wrong[:, 0] * wrong[:, 1] <= 0).all()
    assert len(ax.patches) == 2
    assert all(any(patch.get_bbox().contains(*point) for patch in ax.patches) for point in wrong)
    share = 100 * float(results["misclassified"])
    text = f"misclassified: {share:.3g} %\n(95 % interval: {share - 2:.3g} to {share + 2:.3g} %)"
    assert labels(ax) == ["predicted = true", "same side of the limit", "limit state: 0", text]
    assert ax.get_title() == "Q2 = 0.884 on 600 held-out samples"
    assert ax.get_xlabel() == f"true {OUTCOME} [1]"
    assert ax.get_ylabel() == f"predicted {OUTCOME} [1]"
    assert ax.get_xlim() == ax.get_ylim()


def test_without_a_limit_state_there_are_no_quadrants():
    ax = drawn(plots.predicted_against_true(chaos(limit=None)))
    assert not ax.patches
    assert labels(ax) == ["predicted = true", "held-out samples"]


def test_a_limit_state_has_its_value_and_unit():
    results = chaos(limit=0.03)
    results["true"].attrs["units"] = "m"
    ax = plots.predicted_against_true(results)
    assert "limit state: 0.03 m" in labels(ax)
    true, predicted = results["true"].values, results["predicted"].values
    assert len(points(ax)[1]) == ((true < 0.03) != (predicted < 0.03)).sum()


def test_points_of_a_verdict_are_spread_sideways():
    results = chaos(limit=None)
    results["true"][:] = results["true"] < 0
    results["misclassified"] = 0.1
    ax = drawn(plots.predicted_against_true(results))
    assert "limit state: 0.5" in labels(ax)
    assert ax.get_xlabel().replace("\n", " ").endswith("spread sideways [1]")
    x = np.concatenate(points(ax))[:, 0]
    assert len(set(x)) == 600
    np.testing.assert_array_equal(np.sort(np.round(x)), np.sort(results["true"]))


def test_a_surrogate_not_to_be_trusted_says_why():
    ax = plots.predicted_against_true(chaos(trusted=0))
    assert_inside(ax)
    title = ax.get_title().replace("\n", " ")
    assert "not to be trusted: Q2 is 0.41, below 0.8. 12 of 500 predictions lie outside" in title


def test_unknown_samples_are_counted_not_drawn():
    results = chaos()
    results["true"][:7] = np.nan
    ax = drawn(plots.predicted_against_true(results))
    assert sum(map(len, points(ax))) == 593
    assert "unknown, not drawn: 7 of 600" in labels(ax)
    assert "593 held-out" in ax.get_title()


@pytest.mark.parametrize("samples", [0, 1, 20000])
def test_any_number_of_points(samples):
    results = chaos(samples=20000).isel(held_out=slice(samples))
    ax = drawn(plots.predicted_against_true(results))
    assert sum(map(len, points(ax))) == samples
    if not samples:
        assert texts(ax) == ["no held-out sample is known"]


def test_nothing_known_and_no_q2():
    results = chaos()
    results["true"][:] = np.nan
    results["q2"] = np.nan
    ax = drawn(plots.predicted_against_true(results))
    assert texts(ax) == ["no held-out sample is known"]
    assert ax.get_title().startswith("Q2 = undefined")
