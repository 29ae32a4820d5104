"""What a report of a comparison leaves unsaid where it may be chance, or where things are not alike."""

import numpy as np
import pytest
from compared_results import REPLICATES, compared, integrated, named_race, spread

from hipuq.report.comparison import facts
from hipuq.report.comparison_cost import cost_summary, cost_table, cost_words
from hipuq.report.comparison_error import error_table
from hipuq.report.comparison_interval import interval_table, interval_words
from hipuq.report.comparison_winner import winner_table, winner_words


def assigned(race, **numbers):
    """Return a comparison with other numbers, each of its own shape or one for all."""
    return race.assign(
        {name: (race[name].dims, np.broadcast_to(value, race[name].shape)) for name, value in numbers.items()}
    )


@pytest.fixture(scope="module")
def dear():
    """Return two contenders, one of which takes far longer at a single budget of 4096."""
    return compared({"random": spread(), "dear": spread(beside=10.0)}, budgets=[4096], replicates=30)


def needed(race, same, low, high, even):
    ends = {"": same, "_low": low, "_high": high}
    named = {f"baseline_evaluations{end}": np.array([[4096.0], [value]]) for end, value in ends.items()}
    return assigned(race, break_even=np.array([[np.nan], [even]]), cost_ratio=[[1.0], [50.0]], **named)


# What pays


@pytest.mark.parametrize(
    ("numbers", "cell", "words", "line"),
    [
        (
            (5222, 3710, 8000, 196e-6),
            ["not told apart", "from saving none"],
            ": what it saves of evaluations is not told apart from none",
            "dear (not told apart from saving none)",
        ),
        (
            (3900, 3000, 5000, np.inf),
            ["not told apart", "from saving none"],
            ": what it saves of evaluations is not told apart from none",
            "dear (not told apart from saving none)",
        ),
        (
            (5222, 4200, 8000, 196e-6),
            ["196 µs"],
            ": it would pay where one evaluation takes longer than 196 µs (here 50 µs)",
            "dear (pays where one evaluation takes longer than 196 µs)",
        ),
        (
            (3000, 2500, 4000, np.inf),
            ["never"],
            ", and would with any model: it saves no evaluations",
            "dear (saves no evaluations)",
        ),
        ((9000, 8000, 10000, 0.0), ["always"], "(50 times)", "dear"),
    ],
)
def test_it_pays_where_it_surely_saves_evaluations(dear, numbers, cell, words, line):
    made = needed(dear, *numbers)
    assert cost_table(made).rows[1][-1].split("\n") == cell
    (said,) = cost_words(made)
    assert said.endswith(words)
    assert cost_summary(made) == f"Time for the same error: more than random: {line}"


def test_evaluations_for_the_same_error_have_limits(dear):
    assert cost_table(needed(dear, 5222, 3710, 8000, 1.0)).rows[1][5] == "5,222\n3,710 to 8,000"
    assert cost_table(needed(dear, 5222, 3710, np.inf, 1.0)).rows[1][5] == "5,222\n3,710 or more"
    assert cost_table(needed(dear, np.inf, np.inf, np.inf, 0.0)).rows[1][5] == "never"


@pytest.mark.parametrize(
    ("rate", "said"),
    [
        ((-0.51, -0.62, -0.39), "n^-1/2: its own errors fall as n^-0.51 (-0.62 to -0.39). Below 1"),
        (
            (-0.9, -1.0, -0.8),
            "n^-0.90 (-1.00 to -0.80), so that evaluations for the same error are only rough. Below 1",
        ),
        ((np.nan,) * 3, "n^-1/2: that law is not checked here. Below 1"),
    ],
)
def test_the_law_of_the_baseline_is_told(dear, rate, said):
    made = assigned(dear, **{f"rate{end}": v for end, v in zip(("", "_low", "_high"), rate, strict=True)})
    assert said in cost_table(made).note


# Another model


@pytest.fixture(scope="module")
def foreign():
    ways = {
        "random": spread(),
        "twin": spread(1.0001),
        "better": spread(0.5),
        "integrated": spread(0.1, per=140 * 50e-6),
    }
    return compared(ways, entries={"integrated": {**integrated(), "budgets": [64, 256]}})


def test_winners_with_another_model_are_told_with_its_time(foreign):
    longer = "one evaluation takes 140 times as long"
    assert winner_words(foreign) == (
        "Lowest error: integrated at 64 and 256, better at 1,024 evaluations; integrated evaluates another "
        f"model, {longer}; lowest with the model of random: better at 64 and 256 evaluations"
    )
    table = winner_table(foreign)
    assert table.columns[-1] == "lowest with the model of random"
    marked = "integrated\n(another model,\none evaluation takes\n140 times as long)"
    assert [row[1] for row in table.rows] == [marked, marked, "better"]
    assert table.rows[0][-1].startswith("better\n0.0")
    assert table.rows[2][-1] == "the same"
    assert error_table(foreign).note.endswith(f"; integrated evaluates another model, {longer}")


def test_those_with_the_model_may_not_be_told_apart(foreign):
    two = foreign.sel({"method": ["random", "twin", "integrated"]})
    assert "lowest with the model of random: " in winner_words(two)
    who = winner_table(two).rows[1][-1].split("\n")[0]
    assert who == "random or twin"
    told = two["rmse_low"].values.copy()
    told[1] = 0.99 * two["rmse"].values[1]
    sure = assigned(two, rmse_low=told, rmse_high=1.01 * two["rmse"].values)
    assert winner_table(sure).rows[1][-1].split("\n")[0] == "random"


def test_one_model_needs_no_mark():
    race = named_race()
    assert winner_words(race) == "Lowest error: lhs at every budget"
    assert len(winner_table(race).columns) == 4
    assert "model" not in error_table(race).note


# Intervals


def covered(share, n, *, contenders=1, budgets=(64, 256, 1024), told=None):
    """Return a comparison in which so many of n intervals hold the reference."""
    made = compared({f"c{i}": spread() for i in range(contenders)}, budgets=budgets, replicates=n)
    found = np.broadcast_to(share, made["coverage"].shape)
    return assigned(made, coverage=found, intervals=n if told is None else told)


FINE = "Intervals are not seen to be too narrow or conservative"


def test_few_runs_accuse_nobody():
    assert interval_words(covered(0.0, 3)) == "Intervals are not judged from fewer than 10 runs"
    assert "with fewer than 10 intervals none are called" in interval_table(covered(0.0, 3)).note
    assert interval_words(covered(0.0, 10)).startswith("Intervals too narrow: c0 at every budget")
    assert interval_words(covered(0.0, 12, told=9)).startswith("Intervals are not judged")


def test_accusations_are_at_three_sigma_over_all_that_are_judged():
    # 20 of 25 hits: P = 0.0072 for 95 %; 19: 0.0012; 18: 0.00017.
    assert interval_words(covered(20 / 25, 25, budgets=[64])) == FINE
    assert "too narrow: c0" in interval_words(covered(19 / 25, 25, budgets=[64]))
    assert interval_words(covered(19 / 25, 25)) == FINE
    assert "too narrow: c0" in interval_words(covered(18 / 25, 25))


def test_conservative_at_three_sigma_too():
    # 0.95**129 = 0.00134 and 0.95**128 = 0.00141, with a bar of 0.00135.
    assert "conservative: c0" in interval_words(covered(1.0, 129, budgets=[64]))
    assert interval_words(covered(1.0, 128, budgets=[64])) == FINE
    assert interval_words(covered(1.0, 129)) == FINE
    # As in the study of methods: 300 runs all of which hold, one of some twenty cells.
    mixed = np.full((7, 3), 0.95)
    mixed[3] = 1.0
    said = interval_words(covered(mixed, 300, contenders=7))
    assert said == "Intervals conservative: c3 at every budget (100 %, stated 95 %)"


def test_good_intervals_are_hardly_ever_accused():
    rng = np.random.default_rng(5)
    made = covered(0.95, 30, contenders=8)
    drawn = [rng.binomial(30, 0.95, (8, 3)) / 30 for _ in range(100)]
    assert sum(interval_words(assigned(made, coverage=share)) != FINE for share in drawn) <= 2


def test_the_size_of_the_effect_counts_too():
    assert interval_words(covered(0.93, 4000)) == FINE
    assert "too narrow" in interval_words(covered(0.91, 4000))
    assert interval_words(covered(0.97, 4000)) == FINE
    assert "conservative" in interval_words(covered(0.99, 4000))


def test_runs_without_an_interval_are_told():
    made = compared({"random": spread(), "lucky": spread()}, lost=("lucky", 256))
    told = REPLICATES - 3
    table = interval_table(made)
    assert table.rows[1][2].split("\n")[2] == f"of {told}"
    assert "of" not in table.rows[1][1].split("\n")[-1].split()
    assert table.note == "of so many: the other runs give no interval"
    some = f"lucky at 256 evaluations ({told} of {REPLICATES})"
    assert interval_words(made) == f"{FINE}; only part of the runs give one: {some}"


# Times


def test_times_with_several_numbers_of_threads_are_not_alike(dear):
    said = "Timed with 1 and 2 threads: times are not alike"
    assert said in facts(dear.assign_attrs(jobs="1, 2"))
    assert not any("threads" in line for line in facts(dear))
