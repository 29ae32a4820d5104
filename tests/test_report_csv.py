"""Tables as CSV: numbers to compute with, limits in columns of their own, nothing lost."""

import csv
import html
import io
import re

import pytest
from squeak_results import everything

from hipuq.report.csv import csv_text
from hipuq.report.page import write_report
from hipuq.report.table import Table


def rows(table):
    return list(csv.reader(io.StringIO(csv_text(table), newline="")))


def column(*cells, heading="P"):
    return rows(Table("", [heading], [[cell] for cell in cells]))


def test_lines_end_and_quotes_are_as_in_the_standard():
    assert csv_text(Table("", ["a, b", 'c"'], [["x\ny", ""]])) == '"a, b","c"""\r\nx y,\r\n'


@pytest.mark.parametrize(
    ("cells", "made"),
    [
        (["0.69 (0.68 to 0.70)"], [["P", "P low", "P high"], ["0.69", "0.68", "0.70"]]),
        (["0.25 (bounds 0.2 to 3e-05)"], [["P", "P low", "P high"], ["0.25", "0.2", "3e-05"]]),
        (["0.5 (0.4 to 0.6)", "0"], [["P", "P low", "P high"], ["0.5", "0.4", "0.6"], ["0", "", ""]]),
        (["0.5 (0.4 to 0.6)", ""], [["P", "P low", "P high"], ["0.5", "0.4", "0.6"], [""] * 3]),
        (["0.5 (0.4 to 0.6)", "n/a"], [["P", "P low", "P high"], ["0.5", "0.4", "0.6"], ["n/a", "", ""]]),
        (["0.5 *\n0.4 to 0.6"], [["P", "P low", "P high"], ["0.5", "0.4", "0.6"]]),
        (["0.00989 *", "words *"], [["P"], ["0.00989"], ["words *"]]),
        (["95.1 %\n91.2 to 97.3"], [["P", "P low", "P high"], ["0.951", "0.912", "0.973"]]),
        (["0.5\n0.4 to 0.6", "-"], [["P", "P low", "P high"], ["0.5", "0.4", "0.6"], ["-", "", ""]]),
        (["42 % (39 to 45 %)"], [["P", "P low", "P high"], ["0.42", "0.39", "0.45"]]),
        (["0.1 to 0.2", "0.3"], [["P low", "P high"], ["0.1", "0.2"], ["0.3", "0.3"]]),
        (["-0.01 to 0.2"], [["P low", "P high"], ["-0.01", "0.2"]]),
        (["none to the whole range"], [["P low", "P high"], ["none", "the whole range"]]),
        (["8,192", "1,234,567", "12"], [["P"], ["8192"], ["1234567"], ["12"]]),
        (["0 %", "0.25 %", "-12 %"], [["P"], ["0"], ["0.0025"], ["-0.12"]]),
        (["6, 7, 8", "1,2", "from 1 to 2"], [["P"], ["6, 7, 8"], ["1,2"], ["from 1 to 2"]]),
        (["0.1 to 0.2", "words"], [["P"], ["0.1 to 0.2"], ["words"]]),
        (["n/a", "3"], [["P"], ["n/a"], ["3"]]),
    ],
)  # fmt: skip
def test_cells(cells, made):
    assert column(*cells) == made


def test_rows_stay_beside_each_other():
    table = Table("", ["damping", "P", "n"], [["1 %", "0.5 (0.4 to 0.6)", "1,000"], ["2 %", "n/a", "2"]])
    assert rows(table) == [
        ["damping", "P", "P low", "P high", "n"],
        ["0.01", "0.5", "0.4", "0.6", "1000"],
        ["0.02", "n/a", "", "", "2"],
    ]


def test_the_page_holds_what_its_buttons_copy(tmp_path):
    page = write_report(everything(), tmp_path).read_text(encoding="utf-8")
    texts = [html.unescape(text) for text in re.findall(r'data-csv="([^"]*)"', page)]
    assert len(texts) == page.count("<table")
    tables = [list(csv.reader(io.StringIO(text))) for text in texts]
    for table in tables:
        assert len(table) > 1
        assert len({len(row) for row in table}) == 1
        assert all(table[0])
        assert len(set(table[0])) == len(table[0])
    damping = next(table for table in tables if table[0][0] == "damping ratio")
    assert damping[0] == ["damping ratio", "squeak", "squeak low", "squeak high"]
    values = everything()["squeak/any_unstable"].to_dataset()["probability_overall"].values
    assert [float(row[0]) for row in damping[1:]] == [0.0, 0.005, 0.01]
    assert [float(row[1]) for row in damping[1:]] == pytest.approx(values, abs=5e-5)
    assert '<th scope="col"></th>' not in page
    assert "<tbody>\n</tbody>" not in page
