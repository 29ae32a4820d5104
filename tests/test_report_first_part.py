"""The blocks before the analyses: every number is one of the results, and any part may be missing."""

import io
import json
import re

import numpy as np
import pytest
import xarray as xr
from rich.console import Console
from squeak_results import everything, tree, without

import hipuq
from hipuq.errors import UnknownNameError
from hipuq.models import MODELS, PRESETS, CEAModel
from hipuq.report.figures import pictures
from hipuq.report.first_part import blocks
from hipuq.report.friction import limit_block, onset_words
from hipuq.report.grounds import regime_tables
from hipuq.report.page import content, write_report
from hipuq.report.reading import Reading
from hipuq.report.squeak import headline
from hipuq.report.text import show_results


def made(whole):
    """Return the blocks by their keys."""
    return {one.key: one for one in blocks(Reading(whole))}


@pytest.fixture(scope="module")
def told():
    return made(everything())


def at_one_percent(path):
    return everything()[path].to_dataset(inherit=False).sel(damping_ratio=0.01)


def printed(whole, **options):
    stream = io.StringIO()
    show_results(whole, Console(file=stream, width=100), **options)
    return stream.getvalue()


def test_every_block_has_something_to_say(told):
    order = "squeak damping count mode fragility limit drivers agreement bench trust inputs limits repeat"
    assert list(told) == order.split()


def test_probability_over_damping(told):
    (table,) = told["damping"].tables
    results = everything()["squeak/any_unstable"].to_dataset()
    assert [row[0] for row in table.rows] == ["0 %", "0.5 %", "1 %"]
    for row, value in zip(table.rows, results["probability_overall"].values, strict=True):
        assert row[1].startswith(f"{value:.4f} (")
    assert told["damping"].brief[0].columns == ["damping", "0 %", "0.5 %", "1 %"]


def test_number_in_contact_and_modes(told):
    (table,) = told["count"].tables
    means = at_one_percent("squeak/any_unstable")["probability_mean"].values
    assert [row[2] for row in table.rows] == [f"{value:.4f}" for value in means]
    (table,) = told["mode"].tables
    assert table.columns[:3] == ["mode", "pair", "in the paper"]
    ranges, chances = at_one_percent("squeak/frequencies"), at_one_percent("squeak/unstable")
    for row in table.rows:
        mode = int(row[0])
        assert row[1] == f"{mode - 1}-{mode}"
        assert row[3].startswith(f"{float(chances['probability_overall'].sel(mode=mode)):.4f}")
        assert row[5] == f"{float(ranges['frequency_median'].sel(mode=mode)) / 1000:.3f}"
    assert ["11"] == [row[2] for row in table.rows if row[2]]


def test_friction_limits_in_words(told):
    (table,) = told["limit"].tables
    limits = everything()["exact/friction_limit"].to_dataset()
    assert [row[0] for row in table.rows] == ["1 %", "50 %"]
    assert [float(row[1]) for row in table.rows] == pytest.approx(limits["friction_limit"].values, rel=1e-3)
    odd = limits.copy(deep=True).assign_attrs(confidence=0.95)
    odd["friction_limit"][:] = [-np.inf, np.inf]
    odd["friction_limit_low"][:] = [-np.inf, 0.2]
    odd["friction_limit_high"][:] = [0.1, np.inf]
    groups = {
        "exact/probability": everything()["exact/probability"].to_dataset(),
        "exact/friction_limit": odd,
    }
    (table,) = limit_block(Reading(tree(groups))).tables
    assert [row[1:] for row in table.rows] == [
        ["none", "none to 0.1000"],
        ["the whole range", "0.2000 to the whole range"],
    ]


def test_onsets_in_words():
    onsets = xr.Dataset({"onset": ("sample", [0.1, 0.2, 0.3, np.inf, np.nan])})
    text = " ".join(onset_words(onsets))
    assert "its 5 % quantile is 0.1, its median 0.2, its 95 % quantile beyond the range" in text
    assert "20 % of the configurations are stable" in text
    assert "The onset of 20 % of the configurations is not known" in text
    assert onset_words(onsets.where(False)) == ["No configuration has a known onset"]


def test_drivers_name_their_analysis_and_damping(told):
    text = " ".join(told["drivers"].lines)
    assert "the total-order index of friction lies between" in text
    assert "From the analysis 'drivers' of any_unstable, by sobol, at 1 % modal damping" in text
    assert {row[0] for row in told["drivers"].tables[0].rows} == {"friction", "mass"}


def test_sampled_and_integrated_friction_are_held_together(told):
    (table,) = told["agreement"].tables
    assert [row[:2] + row[3:4] for row in table.rows] == [["1 % modal damping", "squeak", "exact"]]
    assert table.rows[0][-1] == "exact value in the interval"


def test_prediction_beside_what_is_published(told):
    text = " ".join(told["bench"].lines)
    assert "P(squeak) is 66.7 % at 1 % modal damping, the incidence reported 2.7 % to 20.9 %" in text
    assert "probability of 27.5 %" in text
    assert "that lies in the lowest 6 % of the measured 2 to 8 kHz (" in text
    assert ", below 5 to 9 kHz (" in text
    assert [len(table.rows) for table in told["bench"].text] == [5, 3, 2, 6]


def test_trust_counts_all(told):
    (table,) = told["trust"].tables
    whole = everything()["squeak/any_unstable"]
    assert [row[0] for row in table.rows] == ["squeak", "exact", "drivers"]
    assert table.rows[0][1] == str(int(whole["evaluations"].sum()))
    assert table.rows[1][4:7] == ["0", "0", "10"]


def test_inputs_fixed_values_and_how_to_repeat(told):
    inputs, fixed = told["inputs"].text
    assert inputs.rows[0][-1] == "assumed <here>"
    rows = {row[0]: row[2:] for row in fixed.rows}
    assert rows["damping_ratio"] == ["0.01", "1", "swept; the value of the headline", "the study"]
    assert rows["mass"] == ["22.22", "kg", "9 elements, fixed", "preset oberst2016-calibrated"]
    assert "friction" not in rows
    assert "contact" not in rows
    assert any("not the model of one implant" in item for item in told["limits"].items)
    (table,) = told["repeat"].text
    assert ["command", "hipuq run small --seed 3"] in table.rows
    assert ["versions", "hipuq 0.1.0, python 3.12"] in table.rows


# What is missing


@pytest.mark.parametrize(
    "names",
    [
        ("literature",),
        ("drivers",),
        ("exact",),
        ("squeak",),
        ("squeak/frequencies", "squeak/verdicts", "exact/verdicts"),
        ("squeak/unstable",),
        ("squeak/any_unstable",),
        ("exact/fragility", "exact/onsets", "exact/friction_limit"),
        ("squeak", "exact", "literature"),
        ("squeak", "exact", "drivers"),
    ],
    ids="+".join,
)
def test_parts_may_be_missing(names):
    whole = without(everything(), *names)
    found = content(whole, {})
    assert all(one["block"].title for one in found["first"])
    assert printed(whole, everything=True).startswith("Ring & <friends>")


@pytest.mark.parametrize("names", [("literature",), ("squeak",), ("exact", "squeak/unstable")], ids="+".join)
def test_figures_may_be_missing(names):
    assert all(picture.caption for picture in pictures(without(everything(), *names)))


def test_an_older_file_is_read():
    whole = without(everything(), "literature", "squeak/frequencies", "squeak/verdicts", "exact")
    whole["squeak/any_unstable"] = (
        at_one_percent("squeak/any_unstable")
        .drop_attrs(deep=False)
        .assign_attrs(
            {
                key: value
                for key, value in at_one_percent("squeak/any_unstable").attrs.items()
                if key != "over"
            }
        )
        .drop_vars("damping_ratio")
    )
    for key in ("sources", "versions", "command"):
        del whole.attrs[key]
    whole.attrs["report"] = json.dumps({"mode_names": {}})
    found = made(without(whole, "squeak/unstable"))
    assert "No analysis is swept over the damping ratio" in found["damping"].lines[0]
    assert ["command", "hipuq run small --seed 3"] in found["repeat"].text[0].rows


@pytest.mark.parametrize("value", [0.0, 1.0, np.nan])
def test_nothing_everything_or_unknown_is_unstable(value):
    whole = everything().copy(deep=True)
    for path in ("squeak/any_unstable", "squeak/unstable"):
        node = whole[path].to_dataset()
        for name in node.data_vars:
            if str(name).startswith("probability"):
                ends = {"low": 0.0, "high": 1.0} if np.isnan(value) else {}
                node[name] = xr.full_like(node[name], ends.get(str(name).rsplit("_", 1)[-1], value))
        whole[path] = node
    ranges = whole["squeak/frequencies"].to_dataset()
    whole["squeak/frequencies"] = ranges.where(ranges["unstable_samples"] < 0) if value == 0 else ranges
    text = headline(Reading(whole)).lines[0]
    assert {0.0: "= 0: none of", 1.0: "= 1: all of"}.get(value, "is not known") in text
    assert len(content(whole, {})["first"]) == 13
    if value != 1:
        assert all(picture.caption for picture in pictures(whole))
    assert "nan" not in printed(whole, everything=True)


# Page and screen


def test_one_screen_of_text():
    lines = printed(everything()).splitlines()
    assert len(lines) <= 55
    assert lines[1].startswith("P(squeak) = 0.67 (0.44 to 0.84, 95 % interval) at 1 % modal damping")
    assert max(map(len, lines)) <= 100
    for word in ("P(squeak) by number in contact", "[kHz]", "Friction limit", "Numerical trust"):
        assert any(word in line for line in lines)
    assert any(line.startswith("exact: exact, friction integrated, 1 %") for line in lines)


def test_an_analysis_in_full():
    text = printed(everything(), analysis="squeak")
    assert "are at damping ratio 1 % (the one that the study asks for)" in " ".join(text.split())
    assert "over the patterns of each group" in text
    assert "\nexact: " not in text
    assert "\nexact: " in printed(everything(), everything=True)
    with pytest.raises(UnknownNameError, match=r"'squaek'.*'squeak'"):
        printed(everything(), analysis="squaek")


def test_the_page(tmp_path):
    page = write_report(everything(), tmp_path).read_text(encoding="utf-8")
    assert page.index('id="squeak"') < page.index('id="damping"') < page.index('id="details"')
    ids = re.findall(r' id="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'href="#([^"]+)"', page)) <= set(ids)
    assert page.count("<table") == page.count('<button type="button" class="csv" hidden')
    assert "Ring &amp; &lt;friends&gt;" in page
    assert "assumed &lt;here&gt;" in page
    assert "<friends>" not in page
    assert "exact: ring(oberst2016-calibrated), friction integrated, 1 % modal damping</h2>" in page
    files = {file.name for file in (tmp_path / "figures").iterdir()}
    assert page.count("data:image/png") == len(files)
    assert {"squeak-probability_over_damping.png", "exact-fragility.png", "squeak-occurrence.png"} <= files
    assert "http" not in re.sub(r"base64,[^\"]+|doi 10\S+", "", page)


def test_figures_stand_in_one_place():
    found = [(picture.block, picture.analysis, picture.name) for picture in pictures(everything())]
    assert len(found) == len({place[1:] for place in found})
    assert {place[0] for place in found} == {"", "damping", "count", "mode", "fragility", "drivers"}


def test_results_of_a_comparison_alone_have_no_first_part():
    assert content(tree({}), {})["first"] == []


def test_regimes_of_lubrication_have_a_row_each():
    model = hipuq.models.ring()
    inputs = model.inputs(friction=hipuq.lubrication({"film": 0.5, "mixed": 0.25, "boundary": 0.25}))
    found = hipuq.run(model, inputs, method="monte_carlo", n=2, of="any_unstable", rng=1, progress=False)
    (table,) = regime_tables(found)
    assert table.title == "Regimes of friction"
    assert [row[:2] for row in table.rows] == [["film", "0.500"], ["mixed", "0.250"], ["boundary", "0.250"]]
    assert regime_tables(at_one_percent("squeak/any_unstable")) == []


def test_a_sweep_over_friction_too_is_a_map_and_no_curve_over_damping():
    model = hipuq.models.ring()
    over = {"damping_ratio": [0.0, 0.01], "friction": [0.0, 0.05, 0.3]}
    inputs = model.inputs(contact=hipuq.ContactPatterns(in_contact=(9,)))
    found = hipuq.sweep(
        model, inputs, over, method="monte_carlo", n=1, of="any_unstable", rng=1, progress=False
    )  # fmt: skip
    whole = tree({"map/any_unstable": found}, damping_ratio=0.01)
    blocks_made = made(whole)
    assert "damping" not in blocks_made
    assert "over the damping ratio and friction of the analysis 'map'" in blocks_made["squeak"].lines[0]
    assert "at a friction of 0.3" in " ".join(blocks_made["fragility"].lines)
    # No probability leads, so there is no convergence of one.
    assert [picture.name for picture in pictures(whole)][:2] == ["fragility", "stability_map"]
    (section,) = content(whole, {})["sections"]
    (square,) = section["swept"]
    assert square.columns == ["friction", "0 %", "1 %"]
    values = found["probability"].values.T
    assert [row[0] for row in square.rows] == ["0", "0.05", "0.3"]
    assert [[float(cell) for cell in row[1:]] for row in square.rows] == values.round(4).tolist()
    assert "damping ratio 1 % (the one that the study asks for), friction 0" in section["assumed"]


def test_the_same_sweep_at_nominal_values_is_drawn_once():
    sweep = hipuq.evaluate(
        hipuq.models.two_dof(), hipuq.models.two_dof().nominal(friction=[0.0, 0.3, 0.6]), progress=False
    )  # fmt: skip
    drawn = Reading(everything()).found["squeak"]["any_unstable"]
    own = {"any_unstable": drawn, "friction_sweep": sweep}
    groups = {f"{name}/{key}": one for name in "ab" for key, one in own.items()}
    whole = tree(groups, pairs=[])
    assert {picture.analysis for picture in pictures(whole) if picture.name == "dispersion"} == {"a"}
    remarks = [section["remarks"] for section in content(whole, {})["sections"]]
    assert remarks == [[], ["The model over friction at nominal values: the same as of 'a'"]]


def test_every_model_says_what_it_cannot_tell():
    for name, presets in PRESETS.items():
        for preset in presets:
            limits = MODELS[name](preset).limits
            assert len(limits) == len(set(limits)) > len(CEAModel.limits)
            assert not any(line.endswith(".") for line in limits)
