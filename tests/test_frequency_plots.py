"""Figures of the frequencies at which modes are unstable, beside what was measured."""

from itertools import pairwise

import numpy as np
import pytest
import xarray as xr
from drawing import assert_inside, drawn, labels, texts
from matplotlib.text import Text
from plot_results import ONE, literature

from hipuq import plots
from hipuq.errors import SchemaError


def frequencies(median=(np.nan, 2000.0, 2500.0), reach=200.0):
    said = {"long_name": "frequency", "units": "Hz"}
    ends = {"low": -reach, "median": 0.0, "high": reach}
    data = {f"frequency_{key}": ("mode", np.asarray(median) + own, said) for key, own in ends.items()}
    coords = {"mode": np.arange(1, len(median) + 1)}
    return xr.Dataset(data, coords=coords, attrs={"levels": [0.05, 0.5, 0.95]})


SQUEAK = literature([np.nan, np.nan], [2000.0, 5000.0], [8000.0, 9000.0], ["dry", "edge"], "Hz")


def test_ranges_are_in_kilohertz_beside_what_was_measured():
    ax = drawn(plots.mode_frequencies(frequencies(), measured=SQUEAK))
    np.testing.assert_allclose(
        [part[:, 0] for part in ax.collections[0].get_segments()], [(1.8, 2.2), (2.3, 2.7)]
    )
    np.testing.assert_allclose(ax.lines[0].get_xdata(), [2.0, 2.5])
    assert [text.get_text() for text in ax.get_yticklabels()] == ["2", "3"]
    assert (ax.get_xlabel(), ax.get_ylabel()) == (
        "frequency where unstable [kHz]",
        "mode, by ascending frequency",
    )
    bands = [(shown.get_x(), shown.get_x() + shown.get_width()) for shown in ax.patches[:2]]
    np.testing.assert_allclose(bands, [(2, 8), (5, 9)])
    assert len({shown.get_hatch() for shown in ax.patches[:2]}) == 2
    assert {
        "squeak measured, dry: 2 to 8 kHz",
        "5 to 95 % of the samples where unstable",
        "never unstable, not drawn: 1 of 3 modes",
    } <= set(labels(ax))
    assert not ax.child_axes
    assert_inside(ax)


def at_probabilities(values, reach=0.02):
    values = np.asarray(values, dtype=float)
    ends = {"": 0.0, "_low": -reach, "_high": reach}
    data = {f"probability{key}": ("mode", np.clip(values + own, 0, 1), ONE) for key, own in ends.items()}
    return xr.Dataset(data, coords={"mode": np.arange(1, len(values) + 1)}, attrs={"confidence": 0.95})


def bands(ax):
    """Return the boxes of bands in pixels."""
    return [shown.get_window_extent() for shown in ax.patches]


CLOSE = frequencies(reach=1.0, median=(2000.0, 2010.0))


@pytest.mark.parametrize("results", [None, at_probabilities([0.3, 0.31])])
def test_ranges_too_narrow_to_be_seen_are_enlarged(results):
    ax = plots.mode_frequencies(CLOSE, results, measured=SQUEAK)
    assert_inside(ax)
    (inset,) = ax.child_axes
    assert inset.get_xlim()[1] - inset.get_xlim()[0] < 0.03
    np.testing.assert_allclose(inset.lines[0].get_xdata(), [2.0, 2.01])
    assert inset.get_title() == "enlarged [kHz]"
    # It hides neither what was measured nor the data.
    below = inset.get_tightbbox().y0
    assert all(band.y1 < below for band in bands(ax))
    height = ax.transData.transform([(0, value) for value in ax.lines[0].get_ydata()])[:, 1]
    assert (height < below).all()
    ends = [shown.get_x() + shown.get_width() for shown in ax.patches]
    np.testing.assert_allclose(ends, [8.0, 9.0])
    if results is None:
        assert [text.get_text() for text in inset.get_yticklabels()] == ["1", "2"]
        assert not ax.get_yticks().size
    else:
        assert inset.get_ylim()[1] == pytest.approx(1.1 * 33)
        assert max(ax.get_yticks()) < 1.1 * 33


def test_numbers_of_modes_stand_apart_beside_the_axes():
    values = np.array([0.0, 0.3, 0.301, 0.302, 0.299, 0.3, 0.05, 0.31])
    ranges = frequencies(reach=1.0, median=2000.0 + np.arange(8.0))
    ax = drawn(plots.mode_frequencies(ranges, at_probabilities(values), measured=SQUEAK))
    (inset,) = ax.child_axes
    assert texts(inset) == [str(mode) for mode in range(1, 9)]
    # The extent of an annotation holds its line too.
    written = sorted(inset.texts, key=lambda text: Text.get_window_extent(text).y0)
    apart = [Text.get_window_extent(text) for text in written]
    assert all(lower.y1 <= upper.y0 + 1 for lower, upper in pairwise(apart))
    assert all(box.x0 > inset.bbox.x1 for box in apart)
    # By ascending probability, from below.
    assert np.all(np.diff([values[int(text.get_text()) - 1] for text in written]) >= 0)


def test_low_frequencies_are_in_hertz():
    low = frequencies(reach=0.001, median=(np.nan, 0.7307))
    ax = drawn(plots.mode_frequencies(low, at_probabilities([0.0, 0.5])))
    assert ax.get_xlabel() == "frequency where unstable [Hz]"
    np.testing.assert_allclose(ax.lines[0].get_xdata(), [0.7307])
    ticks = [text.get_window_extent() for text in ax.get_xticklabels() if text.get_text()]
    assert all(left.x1 < right.x0 for left, right in pairwise(ticks))
    beside = plots.mode_frequencies(low, measured=SQUEAK)
    assert beside.get_xlabel() == "frequency where unstable [kHz]"
    assert beside.child_axes[0].get_title() == "enlarged [Hz]"
    np.testing.assert_allclose(beside.child_axes[0].lines[0].get_xdata(), [0.7307])


def test_modes_stand_at_their_probability():
    values = {
        "probability": [0.0, 0.3, 0.1],
        "probability_low": [0.0, 0.2, 0.05],
        "probability_high": [0.1, 0.4, 0.2],
    }
    data = {name: ("mode", own, ONE) for name, own in values.items()}
    results = xr.Dataset(data, coords={"mode": [1, 2, 3]}, attrs={"confidence": 0.95})
    ax = drawn(plots.mode_frequencies(frequencies(), results))
    np.testing.assert_allclose(ax.lines[0].get_ydata(), [30, 10])
    assert ax.get_ylabel() == "probability: mode unstable [%]"
    assert texts(ax) == ["2", "3"]
    assert "probability, 95 % interval" in labels(ax)
    with pytest.raises(SchemaError, match=r"of modes \[1, 2\], not"):
        plots.mode_frequencies(frequencies(), results.isel(mode=[0, 1]))
    with pytest.raises(SchemaError, match="'probability' over"):
        plots.mode_frequencies(frequencies(), results.drop_vars("probability"))


def test_modes_of_which_nothing_is_known_are_not_called_stable():
    ranges = frequencies().assign(known_samples=("mode", [0, 9, 9]))
    assert "never known to be unstable, not drawn: 1 of 3 modes" in labels(plots.mode_frequencies(ranges))


def test_no_mode_is_ever_unstable_and_what_is_refused():
    ax = drawn(plots.mode_frequencies(frequencies([np.nan] * 2), measured=SQUEAK))
    assert "never unstable, not drawn: 2 of 2 modes" in labels(ax)
    with pytest.raises(SchemaError, match="'frequency_median' over"):
        plots.mode_frequencies(frequencies().drop_vars("frequency_median"))
    with pytest.raises(SchemaError, match="measured needs 'low' over"):
        plots.mode_frequencies(frequencies(), measured=SQUEAK.drop_vars("low"))
