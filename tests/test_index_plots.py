"""Figures of indices: bars and the heat map; what every figure of results by method does."""

from itertools import pairwise

import matplotlib as mpl
import numpy as np
import pytest
from drawing import assert_inside, drawn, elements, labels, texts
from index_results import NAMES, OUTCOME, REASON, by_mode, chaos, sobol
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


def bars(ax, order):
    """Return the lengths of the bars of one order, from top to bottom."""
    container = next(one for one in ax.containers if one.get_label().startswith(order))
    return [bar.get_width() for bar in container]


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


LONG = 'only 16 of 128 samples of A and B differ, 50 are needed: take more, or analyse of="margin"; ' * 3


@pytest.mark.parametrize("name", ["index_bars", "second_order"])
def test_long_reasons_are_cut(name):
    results = sobol(first=NAN, total=NAN)
    for index in ("S1", "ST", "S2"):
        results[index].attrs["undefined"] = LONG
    outcome, *reason = drawn(FIGURES[name](results)).get_title().split("\n")
    assert outcome == OUTCOME
    assert len(reason) == 2
    assert reason[0].startswith("undefined: only 16 of 128 samples")
    assert reason[1].endswith(" …")


@pytest.mark.parametrize("name", ["index_bars", "second_order"])
def test_a_surrogate_not_to_be_trusted_is_said_in_a_line(name):
    results = chaos(trusted=0)
    assert FIGURES[name](results).get_title() == f"{OUTCOME}\nsurrogate not to be trusted: Q2 0.88"
    results["q2"] = np.nan
    assert FIGURES[name](results).get_title() == f"{OUTCOME}\nsurrogate not to be trusted"
    assert FIGURES[name](chaos()).get_title() == OUTCOME
    modes = by_mode(chaos(trusted=0)).sel(mode=17)
    assert FIGURES[name](modes).get_title().split("\n")[0] == f"{OUTCOME}, mode 17"


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
    assert ax.get_title().endswith("beneath: 95 % interval; hatched: 95 % interval holds 0")
    low, high = (results[f"S2_{end}"].values[1:, :-1] for end in ("low", "high"))
    hatched = {(mark.get_x() + 0.5, mark.get_y() + 0.5) for mark in ax.patches if mark.get_hatch()}
    expected = {(j, i) for i, j in np.argwhere(np.tril((low <= 0) & (high >= 0)))}
    assert 0 < len(expected) < 15
    assert hatched == expected
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
