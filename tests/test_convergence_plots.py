"""Figures of convergence and of a surrogate against the truth."""

from itertools import pairwise

import numpy as np
import pytest
import xarray as xr
from drawing import assert_inside, drawn, elements, labels, texts
from index_results import OUTCOME, REASON, chaos, sobol, variable

from hipuq import plots
from hipuq.errors import SchemaError, UnknownNameError

NAN = [np.nan] * 6

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
    results = sobol(first=NAN, total=NAN)
    results["ST"].attrs["undefined"] = 20 * REASON
    (text,) = texts(drawn(plots.convergence(results)))
    assert text.count("\n") == 1
    assert text.endswith(" …")
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
    assert ax.get_title() == "Q2 0.884 on 600 held-out samples"
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


def test_a_surrogate_not_to_be_trusted_says_so():
    ax = plots.predicted_against_true(chaos(trusted=0))
    assert_inside(ax)
    assert ax.get_title() == "surrogate not to be trusted: Q2 0.88 (600 held out)"


def piled(factor=1.0):
    """Return results whose true values lie close to 0 but for a few."""
    results = chaos()
    results["true"][:] = factor * np.where(np.arange(600) % 20, results["true"] / 100, -0.3)
    results["predicted"] = results["predicted"] * factor
    return results


@pytest.mark.parametrize("factor", [1e-8, 1.0, 1e6])
def test_piled_values_are_drawn_apart(factor):
    ax = plots.predicted_against_true(piled(factor))
    assert_inside(ax)
    assert ax.get_xscale() == ax.get_yscale() == "symlog"
    assert ax.get_xlim() == ax.get_ylim()
    right, wrong = points(ax)
    both = np.concatenate([right, wrong])
    assert ax.get_xlim()[0] < both.min()
    assert both.max() < ax.get_xlim()[1]
    shown = ax.transData.transform(both)[:, 0]
    inner = np.diff(np.quantile(shown, [0.1, 0.9])) / ax.bbox.width
    assert inner > 0.3
    assert all(any(patch.get_bbox().contains(*point) for patch in ax.patches) for point in wrong)


def test_labels_of_a_symmetric_logarithmic_scale_are_few_and_apart():
    far = piled()
    far["predicted"][:3] = [1e9, -1e5, 1e4]
    for results in (piled(), far):
        ax = drawn(plots.predicted_against_true(results))
        left, right = ax.get_xlim()
        assert 0.0 in ax.get_xticks()
        for axis, side in ((ax.xaxis, "x"), (ax.yaxis, "y")):
            ticks = axis.get_majorticklocs()
            order = np.argsort(ticks)
            inside = [i for i in order if left <= ticks[i] <= right]
            assert 3 <= len(inside) < 12
            boxes = [axis.get_majorticklabels()[i].get_window_extent() for i in inside]
            gaps = [getattr(b, f"{side}0") - getattr(a, f"{side}1") for a, b in pairwise(boxes)]
            assert min(gaps) > 0


def test_scales_asked_for():
    assert plots.predicted_against_true(chaos()).get_xscale() == "linear"
    assert plots.predicted_against_true(piled(), scale="linear").get_xscale() == "linear"
    assert drawn(plots.predicted_against_true(chaos(), scale="symlog")).get_yscale() == "symlog"
    with pytest.raises(UnknownNameError, match="did you mean 'symlog'"):
        plots.predicted_against_true(chaos(), scale="symlg")


def test_a_scale_that_does_not_help_is_not_taken():
    """Values piled far from 0 stay piled on a scale that is logarithmic there; equal ones have no range."""
    results = piled()
    results["true"] += 1000
    assert drawn(plots.predicted_against_true(results)).get_xscale() == "linear"
    for value in (0.0, 2.0):
        results["true"][:] = value
        for scale in ("auto", "symlog", "linear"):
            drawn(plots.predicted_against_true(results, scale=scale))


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
    assert ax.get_title().startswith("Q2 undefined")
