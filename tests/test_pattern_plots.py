"""Figures of contact patterns: boxes of their probabilities, and which are in contact."""

from itertools import pairwise

import numpy as np
import pytest
from drawing import assert_inside, drawn, texts
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from plot_results import ONE, by_mode, patterns

from hipuq import plots
from hipuq.errors import InputError, SchemaError

# Boxplots


def legend(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def boxes(ax):
    """Return first and third quartile of each box, (counts, modes, 2), read back from the bars."""
    return np.array(
        [[(bar.get_y(), bar.get_y() + bar.get_height()) for bar in group] for group in ax.containers]
    )


def lines_of(ax, width):
    return [shown for shown in ax.collections if np.isclose(shown.get_linewidth()[0], width)]


def test_boxes_are_quartiles_over_the_patterns():
    results = by_mode()
    ax = drawn(plots.boxplots(results))
    table = 100 * results["probability"].values[:, 1:]
    expected = [table[results["in_contact"] == count] for count in (2, 3, 4)]
    for group, values in zip(boxes(ax), expected, strict=True):
        np.testing.assert_allclose(group, np.quantile(values, [0.25, 0.75], axis=0).T)
    means = [shown.get_ydata() for shown in ax.lines if shown.get_marker() == "D"]
    np.testing.assert_allclose(means, [values.mean(axis=0) for values in expected])
    # Median, then whiskers and their caps.
    medians = [[part[0, 1] for part in shown.get_segments()] for shown in lines_of(ax, 1.8)]
    np.testing.assert_allclose(medians, [np.median(values, axis=0) for values in expected])
    tips = [max(part[:, 1].max() for part in shown.get_segments()) for shown in lines_of(ax, 0.8)[::2]]
    np.testing.assert_allclose(tips, [values.max() for values in expected])
    assert [text.get_text() for text in ax.get_xticklabels()] == ["2", "3", "4"]
    assert legend(ax)[:3] == [
        "2 in contact (6 patterns)",
        "3 in contact (4 patterns)",
        "4 in contact (1 pattern)",
    ]
    assert "whiskers: minimum, maximum" in legend(ax)
    assert (ax.get_xlabel(), ax.get_ylabel()) == (
        "mode, by ascending frequency\nnot shown: 1 (never unstable)",
        "probability: mode unstable [%]",
    )
    assert len({group[0].get_hatch() for group in ax.containers}) == 3
    assert_inside(ax)


def test_boxes_of_chosen_modes_and_counts_stand_beside_each_other():
    ax = drawn(plots.boxplots(by_mode(), counts=[4, 2], modes=[3, 1], names={3: "15"}))
    assert [text.get_text() for text in ax.get_xticklabels()] == ["3\n(15)", "1"]
    assert ax.get_xlabel() == "mode, by ascending frequency (name in the paper)"
    left, right = ([bar.get_x() for bar in group] for group in ax.containers)
    assert left[0] < 0 < right[0] < 0.5 < left[1]
    own = Figure().subplots()
    assert plots.boxplots(by_mode(), ax=own) is own


def test_boxes_are_of_all_modes_that_are_unstable_up_to_twelve():
    ten, many = (plots.boxplots(by_mode(modes=number)) for number in (11, 16))
    assert [text.get_text() for text in ten.get_xticklabels()] == [str(mode) for mode in range(2, 12)]
    assert [text.get_text() for text in many.get_xticklabels()] == [str(mode) for mode in range(5, 17)]
    assert many.get_xlabel().endswith("\nnot shown: 1 (never unstable); 2-4 (unstable too)")
    assert_inside(many)
    # Modes that are not known to be stable are among them; two are no range, as that of a pair would be.
    results = by_mode(modes=4)
    results["probability"][:, 1:3] = 0.0
    results["probability"][0, 0] = np.nan
    assert plots.boxplots(results).get_xlabel().endswith("\nnot shown: 2, 3 (never unstable)")


@pytest.mark.parametrize(("factor", "top"), [(1.0, 104.0), (0.3, None), (0.0, 104.0)])
def test_boxes_of_small_probabilities_have_the_axis_to_themselves(factor, top):
    results = by_mode()
    results["probability"] = factor * results["probability"]
    largest = 100 * float(results["probability"].max())
    assert plots.boxplots(results, modes=[2, 3]).get_ylim()[1] <= (top or 1.1 * largest)
    assert plots.boxplots(results).get_ylim()[1] == pytest.approx(top or 1.1 * largest)


def test_a_single_pattern_collapses_and_unknown_ones_are_told():
    results = by_mode()
    one = drawn(plots.boxplots(results.isel(pattern=[-1])))
    np.testing.assert_allclose(boxes(one)[0][:, 0], boxes(one)[0][:, 1])
    results["probability"][:2, 2] = np.nan
    results["probability"][-1, 2] = np.nan
    ax = drawn(plots.boxplots(results))
    assert texts(ax) == ["?\n2", "?\n1"]
    assert "patterns unknown, their number" in legend(ax)
    assert len(ax.containers[2]) == 2
    stable = results.assign(probability=0 * results["probability"].fillna(0).assign_attrs(ONE))
    drawn(plots.boxplots(stable))


def test_boxplots_refuses():
    results = by_mode()
    with pytest.raises(SchemaError, match="'probability' over"):
        plots.boxplots(patterns())
    with pytest.raises(SchemaError, match="'in_contact' over"):
        plots.boxplots(results.drop_vars("in_contact"))
    with pytest.raises(SchemaError, match="select one, such as"):
        plots.boxplots(results.expand_dims(damping_ratio=[0.0, 0.1]))
    with pytest.raises(InputError, match="number in contact 5 is not in the results"):
        plots.boxplots(results, counts=[5])
    with pytest.raises(InputError, match="mode 9 is not in the results"):
        plots.boxplots(results, modes=[9])
    with pytest.raises(InputError, match="no mode to draw"):
        plots.boxplots(results, modes=[])


# Map of patterns


def meshes(ax):
    return [shown for shown in ax.collections if isinstance(shown, QuadMesh)]


def seen(ax):
    """Return the probability of each cell, (oscillators, columns), by inverting its colour; NaN if white."""
    found = []
    for shown in meshes(ax):
        shown.update_scalarmappable()
        table = shown.cmap(np.linspace(0, 1, 256))
        rows, columns = shown.get_array().shape
        colours = shown.get_facecolor().reshape(rows, columns, 4)
        place = np.abs(colours[..., None, :] - table).sum(axis=-1).argmin(axis=-1)
        value = shown.norm.inverse(place / 255)
        found.append(np.where((colours == 1).all(axis=-1), np.nan, value))
    return np.concatenate(found, axis=1)


def test_cells_have_the_colour_of_their_pattern_where_in_contact():
    results = patterns()
    ax = drawn(plots.pattern_map(results))
    order = np.lexsort([results["probability"], results["in_contact"]])
    contact = results["contact"].values[order].T
    expected = np.where(contact, 100 * results["probability"].values[order], np.nan)
    np.testing.assert_allclose(seen(ax), expected, atol=0.2)
    assert [text.get_text() for text in ax.get_xticklabels()] == ["2\n(6)", "3\n(4)", "4\n(1)"]
    assert [text.get_text() for text in ax.get_yticklabels()] == ["1", "2", "3", "4"]
    # The first oscillator is on top, and groups are apart.
    assert ax.get_ylim()[0] > ax.get_ylim()[1]
    ends = [shown.get_coordinates()[0, [0, -1], 0] for shown in meshes(ax)]
    assert ends[0][1] < ends[1][0] and ends[1][1] < ends[2][0]
    assert ax.figure.axes[1].get_ylabel() == "probability: any mode unstable [%]"
    assert legend(ax) == ["not in contact"]
    assert_inside(ax)


def test_unknown_patterns_come_last_and_are_hatched():
    results = patterns()
    results["probability"][1] = np.nan
    ax = drawn(plots.pattern_map(results, counts=[2]))
    assert np.isnan(seen(ax)[:, -1]).all()
    hatched = next(shown for shown in ax.collections if shown.get_hatch())
    middles = sorted(tuple(path.vertices[:4].mean(axis=0)) for path in hatched.get_paths())
    rows = np.flatnonzero(results["contact"].values[1]) + 1.0
    np.testing.assert_allclose(middles, [(5.5, row) for row in rows])
    assert "in contact, probability unknown" in legend(ax)
    drawn(plots.pattern_map(results.assign(probability=results["probability"] * np.nan)))


def test_all_patterns_of_nine_and_a_single_one_are_readable():
    many = patterns(oscillators=9, counts=(6, 7, 8, 9))
    ax = plots.pattern_map(many)
    assert ax.figure.get_size_inches()[0] == pytest.approx(10)
    assert_inside(ax)
    ticks = [text.get_window_extent() for text in ax.get_xticklabels()]
    assert all(left.x1 < right.x0 for left, right in pairwise(ticks))
    assert ax.get_legend().get_window_extent().y1 < ax.xaxis.label.get_window_extent().y0
    one = plots.pattern_map(many, counts=[9])
    assert_inside(one)
    left, right = one.get_xlim()
    assert right - left >= 8


@pytest.mark.parametrize(
    ("values", "ends"),
    [
        (0.0, (0, 100)),
        (np.nan, (0, 100)),
        (0.004, (0, 10)),
        (0.503, (50, 60)),
        (0.6, (50, 60)),
        (1.0, (90, 100)),
    ],
)
def test_probabilities_that_are_alike_look_alike(values, ends):
    results = patterns()
    results["probability"] = 0 * results["probability"] + values
    norm = meshes(plots.pattern_map(results))[0].norm
    assert (norm.vmin, norm.vmax) == pytest.approx(ends)


def test_pattern_map_refuses():
    results = patterns()
    with pytest.raises(SchemaError, match="'probability' over"):
        plots.pattern_map(results.drop_vars("probability"))
    with pytest.raises(SchemaError, match="over mode too"):
        plots.pattern_map(by_mode())
    with pytest.raises(SchemaError, match="'contact' over"):
        plots.pattern_map(results.drop_vars("contact"))
    with pytest.raises(SchemaError, match="'in_contact' over"):
        plots.pattern_map(results.drop_vars("in_contact"))
    with pytest.raises(InputError, match="number in contact 7"):
        plots.pattern_map(results, counts=[7])
