"""What a report must not claim: onsets at ends of a range, assumptions as facts, limits rounded up."""

import io

import chaospy as cp
import numpy as np
import pytest
import xarray as xr
from rich.console import Console
from squeak_results import CONTACT, PRESET, everything, tree

import hipuq
from hipuq.report.bench import bench
from hipuq.report.figures import pictures
from hipuq.report.first_part import blocks
from hipuq.report.frequency import between, decimals, unit_of
from hipuq.report.friction import limit_block, onset_words, rounded_down
from hipuq.report.page import section
from hipuq.report.printing import narrowed
from hipuq.report.reading import Reading
from hipuq.report.squeak import headline
from hipuq.report.table import Table
from hipuq.report.text import show_results


def run(model, n=4, **inputs):
    made = model.inputs(**inputs)
    return hipuq.run(model, made, method="monte_carlo", n=n, of="any_unstable", rng=1, progress=False)


def printed(whole, width=100):
    stream = io.StringIO()
    show_results(whole, Console(file=stream, width=width))
    return stream.getvalue()


# Onsets and friction limits


def onsets(values, ends=(0.8, 1.0)):
    return xr.Dataset({"onset": ("sample", values, {"range": list(ends)})})


def test_onsets_at_the_ends_of_the_range_are_no_onsets():
    text = " ".join(onset_words(onsets([0.8, 0.8, 0.9, np.inf])))
    assert "its 5 % quantile is at or below 0.8, its median at or below 0.8" in text
    assert "95 % quantile beyond 1, where the range ends" in text
    assert "50 % of the configurations are unstable from the start of the range, 0.8" in text
    assert "25 % of the configurations are stable over the whole range up to a friction of 1" in text


def beside_bench(values, ends):
    groups = {
        "exact/onsets": onsets(values, ends),
        "exact/probability": everything()["exact/probability"].to_dataset(),
    }
    whole = tree(groups | {"literature/critical_friction": hipuq.literature("critical_friction")})
    return " ".join(bench(Reading(whole)).lines)


@pytest.mark.parametrize(
    ("values", "ends", "said"),
    [
        ([0.8, 0.8, 0.9], (0.8, 1.0), "the median onset of the model is at or below 0.8, where the range"),
        ([0.05, np.inf, np.inf], (0.0, 0.1), "no onset up to 0.1, where the range ends."),
        ([0.2, 0.2239, 0.5], (0.0, 1.0), "0.2239, lies below that by a factor of 1.3 to 1.7."),
        ([0.2, 0.78, 0.9], (0.0, 1.0), "0.78, lies above that by a factor of 2.0 to 2.7."),
        ([0.2, 0.3, 0.9], (0.0, 1.0), "0.3, lies within that."),
    ],
)  # fmt: skip
def test_onsets_are_held_against_the_bench_where_they_are_known(values, ends, said):
    text = beside_bench(values, ends)
    assert said in f"{text}.".replace(" The friction of", ". The friction of")


def limits(*values, **attrs):
    """Return the sentences of friction limits, estimate, lower and upper limit of one target."""
    names = ("friction_limit", "friction_limit_low", "friction_limit_high")
    made = {name: ("target", [value]) for name, value in zip(names, values, strict=True)}
    found = xr.Dataset(made, coords={"target": [0.01]}, attrs={"confidence": 0.95} | attrs)
    found["friction_limit"].attrs["range"] = [0.0, 0.4]
    groups = {"a/friction_limit": found, "a/onsets": onsets([0.1] * 10, (0, 0.4))}
    return limit_block(
        Reading(tree(groups | {"a/probability": everything()["exact/probability"].to_dataset()}))
    )


@pytest.mark.parametrize(
    ("values", "attrs", "said"),
    [
        ((0.1255, 0.10429, 0.13), {}, "up to a friction of 0.1042 at most 1 % (estimate 0.1255) of"),
        ((0.1255, -np.inf, 0.13), {}, "Too few configurations (10) for a target of 1 %: no friction can"),
        ((np.inf, np.inf, np.inf), {}, "up to the end of the range, 0.4, at most 1 % of the"),
        ((-np.inf, -np.inf, 0.1), {}, "A target of 1 % is exceeded from the start of the range"),
        ((np.nan, -np.inf, np.inf), {}, "Whether a target of 1 % is kept at any friction is not known"),
        ((0.16608, 0.16608, 0.16608), {"confidence": 1.0}, "Up to a friction of 0.1660 at most 1 % of the"),
    ],
)  # fmt: skip
def test_the_limit_that_can_be_promised_comes_first(values, attrs, said):
    assert said in " ".join(limits(*values, **attrs).lines)


def test_limits_are_never_rounded_up():
    assert rounded_down(0.16609) == 0.1660
    assert rounded_down(0.009497999) == 0.009497
    assert rounded_down(0.3) == 0.3
    assert limits(0.166, 0.13409, 0.17).tables[0].rows == [["1 %", "0.1660", "0.1340 to 0.1700"]]


# What the headline rests on


def of_regimes(ratio=None, alone=("film", "boundary"), damping=0.01):
    """Return the results of a mixture and of some of its regimes alone."""
    model = hipuq.models.ring(PRESET, damping_ratio=0.01)
    other = hipuq.models.ring(PRESET, damping_ratio=damping)
    number = {"film": 5.0, "mixed": 2.0, "boundary": 0.5}
    groups = {"all/any_unstable": run(model, friction=hipuq.lubrication(ratio), contact=CONTACT)}
    for name in alone:
        friction = hipuq.lubrication(number[name])
        groups[f"{name}_alone/any_unstable"] = run(other, friction=friction, contact=CONTACT)
    return tree(groups)


def test_probabilities_of_regimes_are_an_assumption_on_the_first_screen():
    whole = of_regimes()
    values = {
        name: float(whole[f"{name}_alone/any_unstable"]["probability"]) for name in ("film", "boundary")
    }
    told = f"film {values['film']:.3f}, boundary {values['boundary']:.3f}"
    block = headline(Reading(whole))
    assert (
        "It rests on the probabilities of the regimes of lubrication, film 0.27, mixed 0.46, boundary 0.27, "
        f"which are assumed, not measured; in film and boundary alone P is {told}"
    ) in block.lines
    assert f"film 0.27, mixed 0.46, boundary 0.27; alone they give {told}" in " ".join(block.brief)
    assert any(line.startswith("The interval is of sampling alone") for line in block.lines)
    assert "the interval is of sampling alone" in " ".join(printed(whole).split())
    assert not any("alone P is" in line for line in headline(Reading(of_regimes(damping=0.0))).lines)
    given = of_regimes({"film": 0.5, "mixed": 0.0, "boundary": 0.5}, alone=())
    assert any(
        "film 0.50, boundary 0.50, which are given by the user" in one
        for one in headline(Reading(given)).lines
    )
    assert not any("regimes" in line for line in headline(Reading(everything())).lines)
    exact = headline(Reading(tree({"exact/probability": everything()["exact/probability"].to_dataset()})))
    assert not any("of sampling" in line for line in [*exact.lines, *exact.brief])


def test_inputs_stand_once():
    reading = Reading(of_regimes())
    first, other = (section(reading, name) for name in ("all", "film_alone"))
    assert not any(table.rows for table in first["given"])
    assert first["others"] == "The uncertain inputs are those of the headline"
    table, regimes = other["given"]
    assert [row[0] for row in table.rows] == ["friction"]
    assert table.rows[0][-1] == "see below"
    assert [row[0] for row in regimes.rows] == ["film"]
    assert other["others"] == "The other uncertain inputs are those of the headline"
    (inputs,) = [one for one in blocks(reading) if one.key == "inputs"]
    assert [table.title for table in inputs.text] == [
        "Uncertain inputs",
        "Regimes of friction",
        "Nominal and fixed values",
    ]
    assert inputs.text[0].rows[0][-1] == "see below"


# Damping


def test_a_model_without_a_damping_ratio_is_not_told_to_sweep_it():
    whole = tree(
        {"one/any_unstable": run(hipuq.models.two_dof("hulten", damping_1=0.02), friction=cp.Uniform(0, 0.4))}
    )
    text = " ".join(line for block in blocks(Reading(whole)) for line in block.lines)
    assert "damping_ratio" not in text
    assert "over the damping ratio" not in text


def test_a_sweep_at_other_dampings_is_no_result_at_the_headlines():
    model = hipuq.models.ring(PRESET, damping_ratio=0.2)
    groups = {"one/any_unstable": run(model, friction=cp.Uniform(0, 0.4), contact=CONTACT)}
    groups["over/any_unstable"] = everything()["squeak/any_unstable"].to_dataset()
    whole = tree(groups)
    reading = Reading(whole)
    assert reading.apart("over")
    made = {one.key: one for one in blocks(reading)}
    assert "The headline's damping (20 % modal damping) is none of these values" in made["damping"].lines
    values = groups["over/any_unstable"]["probability_overall"].values
    line = next(line for line in printed(whole).splitlines() if line.startswith("over: "))
    assert f"0 to 1 % modal damping, P {values[0]:.4f} to {values[-1]:.4f}, swept" in line
    (table,) = made["trust"].tables
    assert table.rows[1][-2:] == ["0 to 1 % modal damping", f"{values[0]:.4f} to {values[-1]:.4f}"]
    (caption,) = [one.caption for one in pictures(whole) if one.name == "probability_over_damping"]
    assert "20 % modal damping) is none of these" in caption
    assert not Reading(everything()).apart("squeak")


@pytest.mark.parametrize("how", ["variable", "coord", "attribute"])
def test_figures_at_nominal_values_say_at_which_damping(how):
    model = hipuq.models.ring(PRESET)
    samples = model.nominal(friction=[0.0, 0.2, 0.4])
    sweep = hipuq.evaluate(hipuq.models.ring(PRESET, damping_ratio=0.01), samples, progress=False)
    changed = {
        "variable": sweep.assign(damping_ratio=("sample", np.full(3, 0.02))),
        "coord": sweep.assign_coords(damping_ratio=0.02),
        "attribute": sweep.assign_attrs(damping_ratio=0.02),
    }[how]
    whole = tree(
        {"a/any_unstable": run(model, friction=cp.Uniform(0, 0.4)), "a/friction_sweep": changed}, pairs=[]
    )
    captions = {one.name: one.caption for one in pictures(whole)}
    for name in ("dispersion", "root_locus", "damping_ratio"):
        assert "at 2 % modal damping" in captions[name]
        assert "keep their number at its start; elsewhere mode n is the n-th by frequency" in captions[name]


# Drivers, clinic and bench


def test_why_indices_are_undefined():
    whole = everything().copy()
    node = whole["drivers/any_unstable"].to_dataset()
    for name in ("S1", "ST"):
        node[name] = (node[name] * np.nan).assign_attrs(undefined="the outcome does not vary")
    whole["drivers/any_unstable"] = node
    (block,) = [one for one in blocks(Reading(whole)) if one.key == "drivers"]
    assert block.lines[0] == "The indices are undefined: the outcome does not vary"
    assert not any("surrogate" in line for line in block.lines)


@pytest.mark.parametrize(
    ("high", "said"),
    [
        (0.0075, "at most 0.8 %, that is at least 3.6 times less"),
        (0.04, "at most 4.0 %, which does not tell it from what is reported"),
        (0.0, "that none is unstable"),
    ],
)
def test_nothing_unstable_is_not_nothing_at_all(high, said):
    found = everything()["squeak/any_unstable"].to_dataset().sel(damping_ratio=0.01)
    for end, value in (("", 0.0), ("_low", 0.0), ("_high", high)):
        found[f"probability_overall{end}"] = value
    attrs = {key: value for key, value in found.attrs.items() if key != "over"}
    found = found.drop_attrs(deep=False).assign_attrs(attrs)
    whole = tree({"a/any_unstable": found, "literature/incidence": hipuq.literature("incidence")})
    assert said in " ".join(bench(Reading(whole)).lines)


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [
        (2225, 2430, "2.23 to 2.43 kHz: beside squeak on the bench that lies in the lowest 7 % of"),
        (2225, 2430, ", below 5 to 9 kHz ("),
        (7000, 7900, "in the highest 17 % of the measured 2 to 8 kHz"),
        (1000, 2500, "partly within 2 to 8 kHz"),
        (2500, 7500, "within 2 to 8 kHz"),
        (0.7, 0.71, "vibrate at 0.700 to 0.710 Hz: beside squeak on the bench that lies below 2 to 8 kHz"),
    ],
)  # fmt: skip
def test_where_in_the_measured_range_modes_lie(low, high, said):
    whole = everything().copy()
    node = whole["squeak/frequencies"].to_dataset()
    for name, value in (("low", low), ("median", (low + high) / 2), ("high", high)):
        node[f"frequency_{name}"] = xr.full_like(node[f"frequency_{name}"], value)
    whole["squeak/frequencies"] = node
    assert said in " ".join(bench(Reading(whole)).lines)


@pytest.mark.parametrize(
    ("ends", "text"),
    [
        ((2167.4, 2171.9), "2.167 to 2.172 kHz"),
        ((2225, 2430), "2.23 to 2.43 kHz"),
        ((0.70, 0.71), "0.700 to 0.710 Hz"),
        ((950, 950), "950 Hz"),
    ],
)
def test_frequencies_have_the_unit_and_the_digits_that_tell_them_apart(ends, text):
    assert between(*ends) == text


def test_frequencies_of_a_table():
    assert unit_of([np.nan, 700.0, 999.0]) == ("Hz", 1.0)
    assert decimals([2167.0, 2172.0], 1000.0, 4) == 4
    assert decimals([np.nan], 1.0, 4) == 0


# The screen


def words_of(text):
    return set(text.split())


@pytest.mark.parametrize("width", [60, 80, 100])
def test_no_word_is_broken_on_a_narrow_screen(width):
    assert max(map(len, printed(everything(), width).splitlines())) <= width
    assert words_of(printed(everything(), 400)) - words_of(printed(everything(), width)) <= {"0.5", "%"}


def test_columns_go_where_there_is_no_room():
    ratios = [f"{0.25 * i:g} %" for i in range(9)]
    table = Table("", ["damping", *ratios], [["lubrication", *(["0.1234"] * 9)]], keep=(0, 1, 5, 9))
    assert narrowed(table, 100).columns == table.columns
    for width in (80, 60, 45):
        kept = narrowed(table, width)
        assert (
            sum(max(len(kept.columns[i]), len(kept.rows[0][i])) + 2 for i in range(len(kept.columns)))
            <= width
        )
        assert {"damping", "0 %", "1 %", "2 %"} <= {*kept.columns}
    assert narrowed(table, 10).columns == ["damping", "0 %", "1 %", "2 %"]


def test_the_most_probable_modes_are_printed():
    (block,) = [one for one in blocks(Reading(everything())) if one.key == "mode"]
    brief, full = block.brief[0], block.tables[0]
    rest = len(full.rows) - len(brief.rows)
    assert len(brief.rows) == min(6, len(full.rows))
    assert all(row in full.rows for row in brief.rows)
    if rest:
        assert f"and {rest} more, less probable; where unstable they vibrate at" in block.brief[1]


def test_a_preset_that_is_calibrated_says_to_what():
    limits_ = " ".join(hipuq.models.ring(PRESET).limits)
    assert "calibrated to a published simulation" in limits_
    assert "with the film lost (friction 0.3 and above)" in limits_
