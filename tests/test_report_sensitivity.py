"""Sobol indices and polynomial chaos in words and tables."""

import io

import numpy as np
import pytest
import xarray as xr
from index_results import OUTCOME, REASON, SENTENCE, by_mode, chaos, sobol, tree, variable
from rich.console import Console

from hipuq.report.sensitivity import has_indices, in_words, note, remarks
from hipuq.report.summary import estimates, headline, tables
from hipuq.report.text import show_results

NAN = [np.nan] * 6
OF_SURROGATE = (
    "The surrogate of stability margin (negative: unstable): friction explains 47 % of the variance alone, "
    "84 % with its interactions; the 6 parameters alone explain 51 % together"
)


def shown(results):
    """Return the lines that are printed of results."""
    stream = io.StringIO()
    show_results(tree(one=results), Console(file=stream, width=200), analysis="one")
    return stream.getvalue().splitlines()


def table_of(results, title):
    return next(table for table in tables(results) if table.title.startswith(title))


def levels():
    """Return results of a chaos by contact pattern."""
    results = chaos()
    said = {"long_name": "weight", "units": "1"}
    results = results.assign_coords(pattern=[1, 2, 3], weight=("pattern", [0.5, 0.25, 0.25], said))
    for name in ("mean", "variance", "loo", "degree", "terms", "samples_used", "probability_surrogate"):
        whole = results[name]
        results[name] = (("pattern",), [2, 3, 4], whole.attrs)
        if name not in ("degree", "terms", "samples_used"):
            results[f"{name}_overall"] = whole
    names = {f"probability{end}": f"probability_overall{end}" for end in ("", "_low", "_high")}
    return results.rename(names)


# Words


def test_the_most_telling_parameter_in_words():
    assert in_words(sobol()) == SENTENCE
    assert headline(sobol()) == SENTENCE
    assert OF_SURROGATE in remarks(chaos())


@pytest.mark.parametrize(
    ("names", "first", "total", "said"),
    [
        (
            ["friction"],
            [0.98],
            [1.01],
            "friction explains 98 % (95 to 101 %) of the variance alone, 101 % (98 to 104 %) with",
        ),
        (
            ["k1", "k2"],
            [-0.02, 0.0],
            [0.3, 0.9],
            "k2 explains none (-3 to 3 %) of the variance alone, 90 % (87 to 93 %) with",
        ),
        (
            ["spring_stiffness[3]", "k1"],
            [0.2, 0.1],
            [0.5, 0.4],
            "spring stiffness 3 explains 20 % (17 to 23 %)",
        ),
        (
            ["k1", "k2"],
            [np.nan, 0.1],
            [0.8, 0.7],
            "k2 explains 10 % (7 to 13 %) of the variance alone, 70 % (67 to 73 %) with",
        ),
    ],
)
def test_words_of_others(names, first, total, said):
    text = in_words(sobol(names, first, total))
    assert said in text
    assert ("together" in text) is (len(names) > 1 and sum(first) >= max(first))


def test_shares_that_cannot_be_added_up_are_not():
    """First-order indices of little say, or below 0, add up to less than the largest of them."""
    assert "together" not in in_words(sobol(["k1", "k2"], [0.79, -0.02], [0.9, 0.1]))
    text = in_words(sobol(["k1", "k2", "k3"], [0.5, 0.3, -0.04], [0.7, 0.4, 0.1]))
    assert "together" not in text
    assert "k1 explains 50 % (47 to 53 %) of the variance alone, 70 %" in text
    text = in_words(sobol(["k1", "k2"], [-0.04, -0.01], [0.9, 0.1]))
    assert "k1 explains 90 % (87 to 93 %) of the variance with its interactions" in text


def test_wide_intervals_resolve_nothing():
    results = sobol(["k1", "contact_angle"], [0.1, -0.02], [0.5, 1.06], width=0.1)
    results["ST_low"][1], results["ST_high"][1] = 0.4, 2.95
    assert in_words(results) == (
        f"{OUTCOME.capitalize()}: the indices are not resolved: the total-order index of contact angle lies "
        "between 0.40 and 2.95; more samples are needed"
    )
    results["ST_high"][1] = 0.69
    assert "contact angle explains none (-12 to 8 %) of the variance alone" in in_words(results)


@pytest.mark.parametrize(
    ("total", "said"),
    [
        ([0.84, 0.5, 0.4, 0.3, 0.2, 0.77], ""),
        ([0.84, 0.5, 0.4, 0.3, 0.2, 0.79], "that of contact angle"),
        ([0.84, 0.8, 0.4, 0.3, 0.8, 0.8], "those of contact, spring angle and contact angle"),
        ([0.84, 0.8, 0.8, 0.8, 0.8, 0.8], "those of contact, spring stiffness and 3 others"),
    ],
)
def test_a_parameter_that_may_not_be_the_first_is_not_called_so(total, said):
    open_ = f" with its interactions, which is not certain to be the most: the interval overlaps {said};"
    text = in_words(sobol(total=total))
    assert (open_ if said else " with its interactions;") in text
    assert "friction explains" in text


def test_unknown_limits_are_not_told():
    results = sobol()
    for name in ("S1", "ST"):
        for end in ("low", "high"):
            results[f"{name}_{end}"] = results[f"{name}_{end}"] * np.nan
    assert "friction explains 47 % of the variance alone, 84 % with its interactions;" in in_words(results)


def test_no_words_for_what_is_undefined_or_over_modes():
    undefined = sobol(first=NAN, total=NAN)
    assert in_words(undefined) == headline(undefined) == ""
    assert in_words(by_mode(sobol())) == ""


def test_what_is_undefined_not_trusted_or_dropped_is_said():
    assert remarks(sobol()) == ["Dropped for a failed or unknown sample: 2 of 1,024 base points"]
    assert remarks(sobol(first=NAN, total=NAN))[0] == f"Undefined indices: {REASON}"
    results = sobol()
    results["dropped"] = 0
    assert remarks(results) == []
    results["S1_low"].attrs["undefined"] = "too few resamples"
    assert remarks(results) == ["Undefined limits of indices: too few resamples"]
    reasons = chaos(trusted=0)["trusted"].attrs["reasons"]
    assert remarks(chaos(trusted=0)) == [f"The surrogate is not to be trusted: {reasons}"]
    assert remarks(chaos())[1:] == []


def test_a_reason_is_said_once():
    results = sobol(first=NAN, total=NAN)
    assert sum(REASON in line for line in remarks(results)) == 1
    assert results["ST_low"].isnull().all()


def test_remarks_over_modes():
    results = by_mode(chaos())
    results["trusted"][:2] = 0
    results["trusted"].attrs["reasons"] = "mode 16, 17: Q2 is low"
    lines = remarks(results)
    assert "Undefined indices: mode 16: the outcome does not vary" in lines
    assert "The surrogate is not to be trusted for 2 of 3 modes: mode 16, 17: Q2 is low" in lines


def test_headline_of_a_surrogate_is_corrected():
    known = "0.2510 (0.2310 to 0.2710); by the surrogate alone 0.2620"
    assert headline(chaos()) == f"Probability: {OUTCOME} below 0.0: {known}"
    assert headline(levels()).endswith(known)
    assert headline(chaos(limit=None)) == (
        f"Corrected mean of {OUTCOME}: 0.0221 (0.0211 to 0.0231); by the surrogate alone 0.0213"
    )
    unknown = chaos()
    unknown["probability_low"] = np.nan
    assert ": 0.2510; by" in headline(unknown)


def test_other_results_have_no_indices():
    results = xr.Dataset({"probability": 0.5}, attrs={"confidence": 0.95})
    assert not has_indices(results)
    assert remarks(results) == []
    assert note(results) == ""


# Tables


def test_indices_by_parameter():
    table = tables(sobol())[0]
    assert table.columns == ["parameter", "S1 (interval)", "ST (interval)"]
    order = ["friction", "contact", "spring_stiffness", "contact_stiffness", "spring_angle", "contact_angle"]
    assert [row[0] for row in table.rows] == order
    assert table.rows[0][1:] == ["0.470 (0.440 to 0.500)", "0.840 (0.810 to 0.870)"]
    assert table.rows[3][1:] == ["-0.012 (-0.042 to 0.018)", "0.330 (0.300 to 0.360)"]
    assert tables(chaos())[0].rows[0] == ["friction", "0.470", "0.840"]
    assert tables(chaos())[0].columns == ["parameter", "S1", "ST"]


def test_indices_of_a_surrogate_are_called_so():
    def titles(results):
        return [table.title for table in tables(results)]

    one, pairs = titles(chaos())[0], titles(chaos())[-1]
    assert one == f"Sobol indices of the surrogate of {OUTCOME}: alone (S1) and with interactions (ST)"
    assert pairs.startswith(f"Second-order index of the surrogate of {OUTCOME}")
    assert titles(by_mode(chaos()))[:2] == [
        f"{order}-order index of the surrogate of {OUTCOME}" for order in ("Total", "First")
    ]
    assert not any("surrogate" in title for title in titles(sobol()) + titles(by_mode(sobol())))
    assert f"Sobol indices of the surrogate of {OUTCOME}" in " ".join(" ".join(shown(chaos())).split())


def test_undefined_indices_are_not_numbers():
    results = sobol(first=NAN, total=NAN)
    assert all(row[1:] == ["n/a", "n/a"] for row in tables(results)[0].rows)
    assert not any(table.title.startswith("Second") for table in tables(results))
    part = sobol(total=[0.84, np.nan, 0.47, 0.33, 0.33, 0.02])
    assert tables(part)[0].rows[-1] == ["contact", "0.030 (0.000 to 0.060)", "n/a"]


def test_pairs_are_sorted_and_the_largest_told():
    results = sobol()
    table = table_of(results, "Second-order")
    assert table.title.endswith("the 10 largest of 15")
    values = [float(row[2].split()[0]) for row in table.rows]
    assert len(values) == 10
    assert values == sorted(values, reverse=True)
    one = results["S2"].sel(parameter=table.rows[0][0], parameter_2=table.rows[0][1])
    assert values[0] == pytest.approx(float(one), abs=5e-4)
    assert float(one) == float(results["S2"].max())
    assert not any(table.title.startswith("Second") for table in tables(sobol(second=False)))
    assert not any(table.title.startswith("Second") for table in tables(sobol(["k1"], [0.9], [1.0])))


def test_samples_of_a_sobol_design():
    rows = dict(table_of(sobol(), "Samples").rows)
    assert rows["base samples used"] == "1022"
    assert rows[f"mean of {OUTCOME}"] == "0.0213"
    results = sobol()
    results["mean"].attrs["units"] = "Hz"
    variable(results, "events", (), 700, "events")
    rows = dict(table_of(results, "Samples").rows)
    assert rows[f"mean of {OUTCOME} [Hz]"] == "0.0213"
    assert rows["events"] == "700"


def test_fit_of_a_chaos():
    rows = dict(table_of(chaos(), "Polynomial chaos").rows)
    assert rows["degree"] == "3"
    assert rows["leave-one-out error (relative)"] == "0.112"
    assert rows["Q2 on held-out samples"] == "0.884"
    wrong = float(chaos()["misclassified"])
    text = f"{wrong:.4f} ({wrong - 0.02:.4f} to {wrong + 0.02:.4f})"
    assert rows["misclassified held-out samples (share)"] == text
    assert rows["probability by the surrogate alone"] == "0.2620"
    assert rows["probability, corrected by true evaluations"] == "0.2510 (0.2310 to 0.2710)"
    assert rows["mean, corrected by true evaluations"] == "0.0221 (0.0211 to 0.0231)"
    assert rows["to be trusted"] == "yes"
    assert dict(table_of(chaos(trusted=0), "Polynomial chaos").rows)["to be trusted"] == "no"
    quantiles = table_of(chaos(), "Quantiles")
    assert quantiles.columns == ["below", "5 %", "50 %", "95 %"]
    assert quantiles.rows == [["value", "-0.03", "0.02", "0.07"]]


def test_fit_without_a_limit_state():
    rows = dict(table_of(chaos(limit=None), "Polynomial chaos").rows)
    assert not any("probability" in name or "misclassified" in name for name in rows)
    assert rows["mean by the surrogate alone"] == "0.0213"


def test_fit_by_level():
    rows = dict(table_of(levels(), "Polynomial chaos").rows)
    assert rows["degree, over 3 levels"] == "2 to 4"
    assert rows["mean by the surrogate alone"] == "0.0213"
    assert rows["probability by the surrogate alone"] == "0.2620"
    assert rows["probability, corrected by true evaluations"] == "0.2510 (0.2310 to 0.2710)"


@pytest.mark.parametrize("method", [sobol, chaos])
def test_modes_have_a_row_each(method):
    results = by_mode(method())
    total, first, *others = tables(results)
    assert total.title.startswith("Total-order")
    assert first.title.startswith("First-order")
    assert total.columns[:4] == ["mode", "friction", "contact", "spring stiffness"]
    # Mode 16 is undefined: the remarks say why.
    assert [row[0] for row in total.rows] == ["17", "18"]
    assert total.rows[0][1] == "0.840"
    intervals = [table for table in others if table.title.endswith("interval")]
    assert len(intervals) == (2 if method is sobol else 0)
    if method is sobol:
        assert intervals[0].rows[0][:2] == ["17", "0.810 to 0.870"]
    named = tables(results, {"17": "16"})[0]
    assert [row[0] for row in named.rows] == ["17, paper 16", "18"]


def test_no_mode_has_any():
    results = by_mode(sobol())
    for name in ("S1", "ST"):
        results[name] = results[name].where(False)
    assert [table.title for table in tables(results)] == ["Samples"]


# What is printed


def test_screen_of_sobol_indices():
    lines = shown(sobol())
    assert lines[1] == "one: ring, sobol, seed 1"
    assert SENTENCE in " ".join(lines)
    assert any(line.split()[:2] == ["friction", "0.470"] for line in lines)


def test_screen_of_a_chaos():
    text = "\n".join(shown(chaos()))
    assert "0.2510 (0.2310 to 0.2710); by the surrogate alone 0.2620" in text.replace("\n", " ")
    assert "Polynomial chaos" in text
    assert "Quantiles" not in text


def test_screen_of_modes_and_of_nothing():
    assert any(line.split()[:2] == ["17", "0.840"] for line in shown(by_mode(sobol())))
    lines = shown(sobol(first=NAN, total=NAN))
    assert f"Undefined indices: {REASON}" in lines
    assert "" not in lines[3:]


def test_results_of_indices_alone_are_found():
    bare = sobol()[["S1", "ST", "evaluations", "failed", "undecided", "seconds"]]
    assert [of for of, _ in estimates({"margin": bare})] == ["margin"]
