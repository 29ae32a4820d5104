"""Figures over friction of a whole design: fragility curves, and how onsets are distributed."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from plot_results import literature

from hipuq import plots
from hipuq.errors import InputError, SchemaError

FRICTION = np.linspace(0.0, 0.1, 11)


def curve(probability, *, width=0.0, friction=FRICTION, **attrs):
    """Return a fragility curve as results have it."""
    probability = np.asarray(probability, dtype=float)
    known = np.nan_to_num(probability, nan=0.5)
    reach = np.where(np.isnan(probability), 1.0, width)
    values = {
        "probability": probability,
        "probability_low": np.clip(known - reach, 0, 1),
        "probability_high": np.clip(known + reach, 0, 1),
    }
    said = {"long_name": "probability: any mode unstable", "units": "1"}
    return xr.Dataset(
        {name: ("friction", value, said) for name, value in values.items()},
        coords={"friction": friction},
        attrs={"confidence": 0.95} | attrs,
    )


def outcomes(onset, swept=None, **coords):
    said = {"long_name": "friction at the onset of instability (inf: never)", "units": "1"}
    said |= {} if swept is None else {"range": swept}
    return xr.Dataset(
        {"onset": ("sample", np.asarray(onset, dtype=float), said)},
        coords={name: ("sample", value) for name, value in coords.items()},
    )


def drawn(ax):
    """Draw the whole figure, which runs the layout: a warning there is an error here."""
    ax.figure.draw_without_rendering()
    return ax


def labels(ax):
    return ax.get_legend_handles_labels()[1]


def band(ax, number=0):
    """Return the least and the greatest value of a band at each place on x."""
    points = ax.collections[number].get_paths()[0].vertices
    return {x: (points[points[:, 0] == x, 1].min(), points[points[:, 0] == x, 1].max()) for x in points[:, 0]}


RISING = np.clip(np.linspace(-0.5, 1.5, 11), 0, 1)


def test_fragility_shows_percent_and_its_interval():
    ax = drawn(plots.fragility(curve(RISING, width=0.1)))
    np.testing.assert_array_equal(ax.lines[0].get_xdata(), FRICTION)
    np.testing.assert_allclose(ax.lines[0].get_ydata(), 100 * RISING)
    limits = band(ax)
    assert limits[FRICTION[0]] == pytest.approx((0, 10))
    assert limits[FRICTION[5]] == pytest.approx((40, 60))
    assert labels(ax) == ["probability, 95 % interval"]
    assert ax.get_xlabel() == "friction coefficient [1]"
    assert ax.get_ylabel() == "probability: any mode unstable [%]"


def test_an_interval_of_no_width_or_unknown_level_is_not_named():
    assert labels(plots.fragility(curve(RISING))) == ["probability"]
    bare = curve(RISING, width=0.1)
    del bare.attrs["confidence"]
    assert labels(plots.fragility(bare)) == ["probability"]


def test_curves_share_axes():
    ax = Figure(layout="constrained").subplots()
    for name, width in (("6 in contact", 0.1), ("7 in contact", 0.0)):
        assert plots.fragility(curve(RISING, width=width), ax=ax, label=name, limit=0.05) is ax
    drawn(ax)
    assert labels(ax) == [
        "6 in contact, 95 % interval",
        "6 in contact: 5 % reached between 0.0200 and 0.0300",
        "7 in contact",
        "7 in contact: 5 % reached between 0.0200 and 0.0300",
    ]
    first, second = ax.lines
    assert first.get_color() != second.get_color()
    assert first.get_linestyle() != second.get_linestyle()


def test_order_of_friction_does_not_matter_and_data_is_not_changed():
    results = curve(RISING, width=0.1)
    shuffled = results.isel(friction=np.random.default_rng(0).permutation(11))
    before = shuffled.copy(deep=True)
    ax = plots.fragility(shuffled, limit=0.5)
    assert shuffled.identical(before)
    np.testing.assert_array_equal(ax.lines[0].get_xydata(), plots.fragility(results).lines[0].get_xydata())
    assert labels(ax)[1] == "50 % reached between 0.0400 and 0.0500"


def test_one_configuration_is_a_step_between_neighbours():
    step = (FRICTION > 0.045).astype(float)
    ax = drawn(plots.fragility(curve(step), limit=0.05))
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), 100 * step)
    assert labels(ax) == ["probability", "5 % reached between 0.0400 and 0.0500"]
    low, high = ax.get_ylim()
    assert low < 0 and high > 100


@pytest.mark.parametrize(
    ("probability", "said"), [(0 * FRICTION, "5 % not reached"), (1 + 0 * FRICTION, "5 % reached from 0")]
)
def test_never_and_always_unstable(probability, said):
    ax = drawn(plots.fragility(curve(probability), limit=0.05))
    assert labels(ax) == ["probability", said]


def test_limit_is_named_as_finely_as_the_grid():
    friction = np.linspace(0, 1e-5, 11)
    ax = drawn(plots.fragility(curve(RISING, friction=friction), limit=0.125))
    assert labels(ax)[1] == "12.5 % reached between 0.000003 and 0.000004"


def test_unknown_probability_is_a_gap_within_its_bounds():
    holed = np.array([0, np.nan, 0, np.nan, 0.2, 0.4, 0.6, 0.8, 1, np.nan, 1])
    ax = drawn(plots.fragility(curve(holed), limit=0.7))
    np.testing.assert_array_equal(np.isnan(ax.lines[0].get_ydata()), np.isnan(holed))
    assert band(ax)[FRICTION[1]] == pytest.approx((0, 100))
    alone = np.asarray(ax.collections[1].get_offsets())
    np.testing.assert_allclose(alone, [(0, 0), (0.02, 0), (0.1, 100)])
    assert labels(ax)[1] == "70 % reached between 0.0600 and 0.0700"
    nothing = drawn(plots.fragility(curve(np.full(11, np.nan)), limit=0.05))
    assert np.isnan(nothing.lines[0].get_ydata()).all()
    assert labels(nothing)[1] == "5 % not reached"


def test_a_limit_is_not_read_across_a_gap():
    holed = np.array([0, 0, 0, np.nan, np.nan, 1, 1, 1, 1, 1, 1])
    assert "5 % reached between 0.0200 and 0.0500" in labels(plots.fragility(curve(holed), limit=0.05))


def test_single_friction():
    ax = drawn(plots.fragility(curve([0.3], friction=[0.05]), limit=0.05))
    np.testing.assert_allclose(ax.collections[1].get_offsets(), [(0.05, 30)])


def test_fragility_refuses():
    results = curve(RISING)
    for name in ("probability", "probability_low", "probability_high"):
        with pytest.raises(SchemaError, match=f"{name!r} over \\(friction\\)"):
            plots.fragility(results.drop_vars(name))
    with pytest.raises(SchemaError, match="over \\(friction\\)"):
        plots.fragility(results.expand_dims(pattern=2))
    with pytest.raises(SchemaError, match="coord 'friction'"):
        plots.fragility(results.drop_vars("friction"))
    with pytest.raises(SchemaError, match="at least one value"):
        plots.fragility(results.isel(friction=[]))
    with pytest.raises(SchemaError, match="not finite"):
        plots.fragility(results.assign_coords(friction=np.where(FRICTION > 0.05, np.nan, FRICTION)))
    for limit in (0, 1, -0.1, 5, np.nan):
        with pytest.raises(InputError, match="limit is"):
            plots.fragility(results, limit=limit)


# Onsets


def test_onsets_step_at_their_values():
    ax = drawn(plots.onset_distribution(outcomes([0.05, 0.02, np.inf, 0.05])))
    shown = ax.lines[0]
    assert shown.get_drawstyle() == "steps-post"
    x, y = shown.get_data()
    # Nothing is known beyond the last onset.
    np.testing.assert_allclose(x, [0, 0.02, 0.05, 0.05])
    np.testing.assert_allclose(y, [0, 25, 75, 75])
    assert labels(ax) == ["onset at or below", "never unstable: 25 % (1 of 4)"]
    assert ax.get_xlabel() == "friction coefficient at the onset [1]"
    assert ax.get_ylabel() == "share of configurations [%]"
    given = Figure().subplots()
    assert plots.onset_distribution(outcomes([0.1]), ax=given) is given


def test_unknown_onsets_bound_the_share():
    data = outcomes([0.05, 0.02, np.inf, np.nan, np.nan], swept=(0.0, 0.1))
    ax = drawn(plots.onset_distribution(data))
    np.testing.assert_allclose(ax.lines[0].get_ydata(), [0, 100 / 3, 200 / 3, 200 / 3])
    limits = band(ax)
    # As if the two were never unstable, and as if they always were.
    assert limits[0.0] == pytest.approx((0, 40))
    assert limits[ax.lines[0].get_xdata()[-1]] == pytest.approx((40, 80))
    assert labels(ax) == ["unknown: 2 of 5", "onset at or below", "never unstable: 33.3 % (1 of 3)"]


def test_levels_count_by_their_weight():
    data = outcomes([0.05, 0.02, np.inf], weight=[0.5, 0.25, 0.25])
    ax = drawn(plots.onset_distribution(data))
    np.testing.assert_allclose(ax.lines[0].get_ydata(), [0, 25, 75, 75])
    assert ax.get_ylabel() == "share of configurations (weighted) [%]"
    # Two samples of each level: the same shares.
    twice = plots.onset_distribution(xr.concat([data, data], "sample"))
    np.testing.assert_allclose(twice.lines[0].get_ydata(), [0, 25, 75, 75])
    even = plots.onset_distribution(outcomes([0.05, 0.02], weight=[0.1, 0.1]))
    assert even.get_ylabel() == "share of configurations [%]"


@pytest.mark.parametrize("onset", [[0.1, 0.1], [0.12, np.inf], [0.4, 0.1], [np.inf] * 2, [np.nan] * 2])
def test_the_range_that_was_swept_is_drawn(onset):
    ends = np.array([0.1, 0.4])
    ax = drawn(plots.onset_distribution(outcomes(onset, swept=ends)))
    for shown in ax.lines:
        np.testing.assert_array_equal(shown.get_xdata()[[0, -1]], ends)
    for shown in ax.collections:
        assert all(path.vertices[:, 0].min() >= 0.1 for path in shown.get_paths())
    np.testing.assert_allclose(ax.get_xlim(), [0.094, 0.406])
    said = plots.onset_distribution(outcomes(onset), limits=limits([np.inf] * 2, [np.inf] * 2, [np.inf] * 2))
    if np.isfinite(onset).all():
        np.testing.assert_array_equal(said.lines[0].get_xdata()[[0, -1]], [0, max(onset)])


def test_all_never_unstable():
    ax = drawn(plots.onset_distribution(outcomes([np.inf] * 9)))
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), [0, 0])
    assert labels(ax)[1] == "never unstable: 100 % (9 of 9)"
    # Nobody knows how far was looked.
    assert not ax.get_xticks().size
    assert ax.get_xlabel().endswith(": none, and the range is not known")


def test_all_unstable_from_the_start_and_a_single_one():
    ax = drawn(plots.onset_distribution(outcomes([0.0, 0.0])))
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), [0, 100, 100])
    assert labels(ax)[1] == "never unstable: 0 % (0 of 2)"
    ax = drawn(plots.onset_distribution(outcomes([0.053])))
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), [0, 100, 100])


def test_all_onsets_unknown():
    ax = drawn(plots.onset_distribution(outcomes([np.nan] * 3)))
    assert not ax.lines
    assert labels(ax) == ["unknown: 3 of 3"]
    assert list(band(ax).values()) == [(0, 100), (0, 100)]


def test_onset_distribution_refuses():
    with pytest.raises(ValueError, match="onset"):
        plots.onset_distribution(outcomes([0.1]).rename(onset="offset"))
    with pytest.raises(SchemaError, match="over sample alone"):
        plots.onset_distribution(outcomes([0.1]).expand_dims(mode=2))
    with pytest.raises(SchemaError, match="dim 'sample'"):
        plots.onset_distribution(outcomes([0.1]).isel(sample=0))
    with pytest.raises(SchemaError, match="-inf in sample 1"):
        plots.onset_distribution(outcomes([0.1, -np.inf]))


# What was measured, and what is allowed


CRITICAL = literature([0.03, 0.09, 0.12, 0.4], [0.02, np.nan, 0.11, 0.3], [0.04, np.nan, 0.13, 0.5])


def test_critical_friction_is_marked_in_and_near_the_range():
    ax = drawn(plots.fragility(curve(RISING), critical=CRITICAL))
    marks = [shown for shown in ax.collections if shown.get_label().startswith("squeak set in")]
    assert [float(shown.get_offsets()[0, 0]) for shown in marks[:-1]] == [0.03, 0.09, 0.12]
    assert len({shown.get_paths()[0].vertices.tobytes() for shown in marks[:-1]}) == 3
    ends = [(shown.get_x(), shown.get_x() + shown.get_width()) for shown in ax.patches]
    np.testing.assert_allclose(ends, [(0.02, 0.04), (0.09, 0.09), (0.11, 0.13)])
    assert labels(ax)[1:] == [
        "squeak set in on the bench, source 0: 0.03 (0.02 to 0.04)",
        "squeak set in on the bench, source 1: 0.09",
        "squeak set in on the bench, source 2: 0.12 (0.11 to 0.13)",
        "squeak set in on the bench at 0.4: beyond the range",
    ]
    # The next curve still takes the next style.
    assert len(ax.lines) == 1


def test_critical_friction_all_beyond_the_range():
    ax = drawn(plots.fragility(curve(RISING), critical=literature([0.29, 0.39])))
    assert labels(ax)[1:] == ["squeak set in on the bench at 0.29 to 0.39: beyond the range"]
    assert ax.get_xlim()[1] < 0.11
    with pytest.raises(SchemaError, match="critical needs 'value' over"):
        plots.fragility(curve(RISING), critical=curve(RISING))


def test_a_mapping_draws_several_curves():
    ax = drawn(plots.fragility({"6": curve(RISING), "7": curve(RISING / 2)}, critical=CRITICAL, limit=0.05))
    assert labels(ax)[:4:2] == ["6", "7"]
    np.testing.assert_allclose(ax.lines[1].get_ydata(), 50 * RISING)
    with pytest.raises(InputError, match="mapping"):
        plots.fragility({})
    with pytest.raises(InputError, match="mapping"):
        plots.fragility({"6": curve(RISING)}, label="7")
    assert labels(plots.fragility(curve(RISING, width=0.1, confidence=1.0))) == [
        "probability, limits of the unknown"
    ]


def limits(values, low, high, targets=(0.05, 0.5), **attrs):
    data = {"friction_limit": values, "friction_limit_low": low, "friction_limit_high": high}
    said = {"units": "1", "range": [0.0, 0.1]}
    return xr.Dataset(
        {name: ("target", np.asarray(own, dtype=float), said) for name, own in data.items()},
        coords={"target": list(targets)},
        attrs={"confidence": 0.95} | attrs,
    )


def test_friction_limits_stand_at_their_targets():
    given = limits([0.02, 0.05], [0.01, -np.inf], [0.03, np.inf])
    ax = drawn(plots.onset_distribution(outcomes([0.02, 0.05, 0.08, np.inf]), limits=given))
    marks = [shown for shown in ax.collections if "not exceeded" in str(shown.get_label())]
    np.testing.assert_allclose([shown.get_offsets()[0] for shown in marks], [(0.02, 5), (0.05, 50)])
    bars = [shown.get_segments()[0][:, 0] for shown in ax.collections if shown.get_linewidth()[0] == 2.0][1:]
    np.testing.assert_allclose(bars, [(0.01, 0.03), (0.0, 0.1)])
    assert labels(ax)[2:] == [
        "5 %: not exceeded up to friction 0.02 (95 % interval: 0.01 to 0.03)",
        "50 %: not exceeded up to friction 0.05 (95 % interval: start to end)",
    ]


def test_friction_limits_that_are_none_are_told():
    given = limits([np.inf, -np.inf], [np.inf, -np.inf], [np.inf, -np.inf])
    ax = drawn(plots.onset_distribution(outcomes([0.02, np.inf]), limits=given))
    assert labels(ax)[2:] == [
        "5 %: not exceeded up to friction 0.1",
        "50 %: exceeded from the start of the range",
    ]
    unknown = limits([np.nan, 0.05], [-np.inf, 0.05], [np.inf, 0.05])
    shown = labels(drawn(plots.onset_distribution(outcomes([0.02, np.inf]), limits=unknown)))
    assert shown[2] == "5 %: not known"
    with pytest.raises(SchemaError, match="limits need 'friction_limit_low'"):
        plots.onset_distribution(outcomes([0.02]), limits=given.drop_vars("friction_limit_low"))
