"""Comparisons of methods in words and tables."""

import numpy as np
import pytest
import xarray as xr
from compared_results import (
    BUDGETS,
    CONTENDERS,
    REPLICATES,
    compared,
    index_race,
    integrated,
    named_race,
    spread,
)

from hipuq.report.comparison import contender_table, facts, parameter_table, remarks, tables
from hipuq.report.comparison_cost import cost_summary, cost_table, cost_words
from hipuq.report.comparison_error import bias_table, bias_words, error_table
from hipuq.report.comparison_interval import interval_table, interval_words
from hipuq.report.comparison_winner import time_table, winner_table
from hipuq.report.table import count, duration, factor, significant


def rows(table):
    """Return first cell -> the others, each in its lines."""
    return {row[0]: [cell.split("\n") for cell in row[1:]] for row in table.rows}


@pytest.fixture(scope="module")
def race():
    return named_race()


@pytest.fixture(scope="module")
def indices():
    return index_race()


# Errors


def test_errors_stand_with_limits_and_rate(race):
    table = error_table(race)
    assert table.columns == ["contender", "64", "256", "1,024", "falls as"]
    found = rows(table)
    for i, name in enumerate(CONTENDERS):
        for j in range(3):
            value, *limits = (float(race[f"rmse{end}"][i, j]) for end in ("", "_low", "_high"))
            if np.isnan(value):
                assert found[name][j] == ["n/a"]
                continue
            number, between = found[name][j]
            assert float(number.removesuffix(" *")) == pytest.approx(value, rel=5e-3)
            told = [float(text) for text in between.split(" to ")]
            assert told == pytest.approx(limits, rel=5e-2)
    rate = race["rate"].values[0]
    assert found["random"][3][0] == f"n^{rate:.2f}"
    assert found["chaos"][2:] == [["n/a"], ["n/a"]]


def test_the_lowest_error_and_its_rivals_are_marked(race):
    found = rows(error_table(race))
    assert [cell[0].endswith("*") for cell in found["lhs"][:3]] == [True] * 3
    assert error_table(race).note == "* the lowest error of a budget"
    twins = compared({name: CONTENDERS[name] for name in ("random", "twin", "shifted")})
    table = error_table(twins)
    said = {row[0]: "".join(cell.split("\n")[0][-1] for cell in row[1:4]) for row in table.rows}
    ratio = twins["rmse_ratio_low"].values
    for i, name in enumerate(said):
        for j in range(3):
            best = float(twins["rmse_ratio"][i, j]) == 1
            assert said[name][j] == ("*" if best else "=") or ratio[i, j] > 1
    assert not set(said["shifted"]) & set("*=")
    assert "= not told apart from it" in table.note


def test_evaluations_that_are_not_the_budget_are_told():
    budgets = (50, 300, 1024)
    ways = {"random": spread(), "sobol": spread()}
    made = compared(ways, budgets=budgets, entries={"sobol": {"method": "sobol"}})
    found = rows(error_table(made))
    used = made["evaluations"].values
    assert used[1].tolist() == [32, 256, 1024]
    for j, budget in enumerate(budgets):
        assert len(found["random"][j]) == 2
        more = [f"{used[1, j]:,} evaluations"] if used[1, j] != budget else []
        assert found["sobol"][j][2:] == more


def test_undefined_estimates_are_told():
    made = compared({"random": spread(), "other": spread()}, lost=("other", 256))
    assert rows(error_table(made))["other"][1] == ["n/a", f"undefined in 3 of {REPLICATES}"]
    assert "Estimates are undefined in some replicates: other at 256 evaluations" in remarks(made)
    assert rows(bias_table(made))["other"][1] == ["n/a"]
    assert [row[0] for row in winner_table(made).rows] == ["64", "1,024"]


def test_an_error_of_zero_wins():
    exact = {"random": spread(), "exact": spread(0.0), "rounded": spread(1e-15)}
    made = compared(exact, replicates=30)
    found = rows(error_table(made))
    assert found["exact"][:3] == [["0 *"]] * 3
    assert all(cell[0].endswith(" *") for cell in found["rounded"][:3])
    assert winner_table(made).rows[0][1:] == ["exact and rounded", "0", "-"]
    assert rows(bias_table(made))["exact"] == [["+0.0"]] * 3
    cost = {tuple(row[:2]): row for row in cost_table(made).rows}
    assert cost["exact", "64"][-3:] == ["never", "0", "always"]
    assert "No number of random evaluations reaches the error of exact" in remarks(made)
    assert "less than random: exact at every budget" in cost_summary(made)


# Bias


def test_a_bias_is_flagged(race):
    found = rows(bias_table(race))
    z = race["bias"].values / race["bias_error"].values
    assert found["shifted"] == [[f"{value:+.1f}", "biased"] for value in z[4]]
    assert all(len(cell) == 1 for name in found if name != "shifted" for cell in found[name])
    assert found["random"][0] == [f"{z[0, 0]:+.1f}"]
    assert bias_words(race) == "Biased, as far as the replicates tell: shifted at every budget"


def test_few_replicates_take_more_to_tell_a_bias():
    made = compared({"random": spread(0.5, bias=0.0)}, budgets=[64], replicates=4)
    shift = 3.5 * float(made["bias_error"][0, 0])
    near = made.assign(bias=xr.full_like(made["bias"], shift))
    assert rows(bias_table(near))["random"] == [["+3.5"]]
    many = near.assign(replicates=xr.full_like(made["replicates"], 400))
    assert rows(bias_table(many))["random"] == [["+3.5", "biased"]]


def test_the_same_few_events_each_time_are_no_bias():
    """Estimates that agree by chance have intervals that hold the answer."""
    made = compared({"random": spread(0.0, bias=0.01)}, budgets=[64], replicates=12)
    assert rows(bias_table(made))["random"] == [["each time off", "biased"]]
    wide = made.assign(low=made["low"] - 0.1, high=made["high"] + 0.1)
    assert rows(bias_table(wide))["random"] == [["each time off"]]


def test_nobody_is_called_biased_by_fewer_than_ten_replicates():
    made = compared({"random": spread(0.5, bias=5.0)}, budgets=[64], replicates=9)
    assert float(made["bias"][0, 0]) > 100 * float(made["bias_error"][0, 0])
    assert bias_words(made) == ""
    assert bias_table(made).note == "with fewer than 10 replicates nobody is called biased"


def test_the_limits_of_a_reference_leave_a_bias_open():
    made = compared({"random": spread(0.5, bias=0.1)}, limits=0.12)
    assert [cell[1] for cell in rows(bias_table(made))["random"]] == ["biased?"] * 3
    assert bias_words(made) == ""
    said = next(line for line in facts(made) if line.startswith("Reference"))
    assert "0.4 (0.28 to 0.52); made up. Half the width of its limits is 0.12, the lowest error 0.1" in said


def test_the_same_wrong_answer_each_time_is_a_bias():
    made = compared({"random": spread(), "wrong": spread(0.0, bias=0.01)}, replicates=10)
    assert rows(bias_table(made))["wrong"] == [["each time off", "biased"]] * 3
    assert "wrong at every budget" in bias_words(made)


# Intervals


def test_coverage_is_told_with_limits_and_in_words(race):
    table = interval_table(race)
    found = rows(table)
    share, low, high = (100 * float(race[f"coverage{end}"][0, 0]) for end in ("", "_low", "_high"))
    assert found["random (95\u00a0%)"][0] == [f"{share:.1f} %", f"{low:.1f} to {high:.1f}"]
    assert found["shifted (95\u00a0%)"] == [["n/a"]] * 3
    words = interval_words(race)
    assert words.startswith("Intervals too narrow: chaos at every budget (")
    assert "stated 90 %" in words
    assert words.endswith("; shifted gives none")


@pytest.mark.parametrize(
    ("width", "said"),
    [
        (1.96, "Intervals are not seen to be too narrow or conservative"),
        (4.0, "Intervals conservative: random at every budget (100 %, stated 95 %)"),
        (None, "Intervals: no contender gives any"),
    ],
)
def test_words_of_coverage(width, said):
    made = compared({"random": spread(width=width)})
    assert interval_words(made) == said
    assert bool(interval_table(made).rows) is (width is not None)


def test_few_runs_call_no_interval_conservative():
    made = compared({"random": spread(width=9.0)}, replicates=30)
    assert float(made["coverage"].min()) == 1
    assert interval_words(made) == "Intervals are not seen to be too narrow or conservative"


# Winners and costs


def test_winners_by_evaluations_and_by_time(race):
    assert [row[:2] for row in winner_table(race).rows] == [["64", "lhs"], ["256", "lhs"], ["1,024", "lhs"]]
    times = time_table(race).rows
    assert [row[0] for row in times] == ["10 ms", "100 ms", "1 s"]
    assert times[0][1:3] == ["lhs", "64"]
    assert times[1][1:3] == ["lhs", "1,024"]
    shortest = compared({"slow": spread(0.1, beside=5.0), "quick": spread(1.0)})
    assert [row[1] for row in time_table(shortest).rows] == ["quick", "quick", "quick", "slow"]


def test_costs_are_those_of_the_dataset(race):
    found = {tuple(row[:2]): row[2:] for row in cost_table(race).rows}
    assert len(found) == 14
    assert found["random", "64"][3:] == ["-"] * 3
    i, j = 2, 2
    one = race["model_time"].values[i, j] / 1024
    times = [race["run_time"].values[i, j], (race["run_time"] - race["model_time"]).values[i, j], one]
    assert found["lhs", "1,024"][:3] == [duration(value) for value in times]
    same = [f"{float(race[f'baseline_evaluations{end}'][i, j]):,.0f}" for end in ("", "_low", "_high")]
    assert found["lhs", "1,024"][3] == f"{same[0]}\n{same[1]} to {same[2]}"
    assert found["lhs", "1,024"][4] == factor(float(race["cost_ratio"][i, j]))
    assert found["chaos", "64"][5] == "never"


def test_costs_in_words(race):
    twin, lhs, chaos, shifted = cost_words(race)
    assert twin.startswith("To reach the same error as random, twin takes ")
    assert "about as much " in twin
    assert lhs.startswith("To reach the same error as random, lhs takes less time at every budget (0.")
    assert chaos.endswith(" times), and would with any model: it saves no evaluations")
    assert "shifted takes more time at every budget (" in shifted
    line = cost_summary(race)
    assert "less than random: lhs at every budget; about that of random: twin" in line
    assert line.endswith("more than random: chaos (saves no evaluations), shifted (saves no evaluations)")


def test_what_would_make_a_dear_method_pay():
    made = compared({"random": spread(1.0), "dear": spread(0.1, beside=10.0)})
    least = float(made["break_even"][1].min())
    budget = BUDGETS[int(made["break_even"][1].values.argmin())]
    (line,) = cost_words(made)
    told = f"takes longer than {duration(least)} (here 50 µs)"
    assert line.endswith(f"times): it would pay at {budget:,} evaluations where one evaluation {told}")
    assert f"dear (pays at {budget:,} evaluations where one evaluation takes longer" in cost_summary(made)
    assert cost_table(made).rows[-1][-1] == duration(float(made["break_even"][1, -1]))


def test_another_model_has_no_time_from_which_it_pays(race):
    ways = {"random": spread(), "integrated": spread(beside=1.0)}
    made = compared(ways, entries={"integrated": integrated()})
    assert cost_table(made).rows[-1][-1] == "other model"
    assert cost_words(made)[0].endswith("times): it evaluates another model")
    table = contender_table(made)
    assert table.columns[2] == "model"
    assert "friction integrated" in table.rows[1][2]
    assert "model" not in contender_table(race).columns


# Several numbers, one budget, one contender


def test_errors_of_indices_by_parameter(indices):
    table = parameter_table(indices)
    assert table.columns == ["parameter", "reference", "random", "sobol"]
    assert [row[:2] for row in table.rows] == [["friction", "0.8"], ["k1", "0.3"]]
    for i, row in enumerate(table.rows):
        assert row[2] == significant(float(indices["rmse"][0, -1, i]))
        assert row[3] == f"{significant(float(indices['rmse'][1, -1, i]))} *"
    assert (
        error_table(indices).title
        == "Error: root mean square error over the 2 parameters, by budget of evaluations"
    )
    whole = float(indices["rmse_overall"][0, 0])
    assert rows(error_table(indices))["random"][0][0] == significant(whole)
    z = (indices["bias"] / indices["bias_error"]).values[0, 0]
    far = int(np.abs(z).argmax())
    assert rows(bias_table(indices))["random"][0] == [f"{z[far]:+.1f}", ["friction", "k1"][far]]
    assert "2 parameters" in facts(indices)[0]
    assert "0.3 to 0.8" in facts(indices)[1]


def test_levels_are_compared_as_a_whole():
    made = compared({"a": spread(), "b": spread(0.1)}, {1: 0.0, 2: 0.5, 3: 1.0}, dims=("pattern",))
    assert parameter_table(made).rows == []
    assert "over the 3 patterns" in error_table(made).title
    assert rows(bias_table(made))["a"][0][1].startswith("pattern ")
    assert len(tables(made)) == 6


def test_units_stand_in_headings():
    made = compared({"a": spread(), "b": spread()}, units="Hz")
    assert error_table(made).title.startswith("Error: root mean square error [Hz]")
    assert "error [Hz]" in winner_table(made).columns


def test_fewer_replicates_are_named():
    made = compared({"a": spread(), "b": spread()}, replicates=40, entries={"b": {"replicates": 10}})
    total = sum(BUDGETS) * 50
    assert facts(made)[2] == f"40 replicates (b 10), seed 7, {total:,} evaluations in all"


# Numbers


def test_numbers_as_text():
    assert [significant(value) for value in (0.0, 0.0120, 1.0, 123.4, 1.5e-7)] == [
        "0",
        "0.0120",
        "1.00",
        "123",
        "1.50e-07",
    ]
    assert significant(np.nan) == "n/a"
    times = (0.0, 3e-8, 9.9996e-4, 0.0032, 59.99, 75.0, 7200.0, 9e6)
    assert [duration(value) for value in times] == [
        "0 µs",
        "0.03 µs",
        "1 ms",
        "3.2 ms",
        "1 min",
        "1.25 min",
        "2 h",
        "2,500 h",
    ]
    assert [count(value) for value in (12.4, 123456.0, 2.5e7, np.inf)] == [
        "12",
        "123,456",
        "2.50e+07",
        "never",
    ]
    assert [factor(value) for value in (0.0, 0.034, 1.0, 16.2, 2812.0)] == [
        "0",
        "0.034",
        "1.0",
        "16",
        "2,800",
    ]


def test_errors_by_parameter_are_of_a_budget_that_all_take():
    truth = {"friction": 0.4, "k1": 0.1}
    entries = {"chaos": {"budgets": [64, 256]}}
    made = compared({"sobol": spread(), "chaos": spread(0.2)}, truth, entries=entries, dims=("parameter",))
    table = parameter_table(made)
    assert table.title == "Error by parameter at 256 evaluations"
    for i, row in enumerate(table.rows):
        for j, cell in enumerate(row[2:]):
            error = float(made["rmse"].isel(method=j, budget=1, parameter=i))
            assert float(cell.removesuffix(" *")) == pytest.approx(error, rel=5e-3)
