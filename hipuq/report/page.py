"""One self-contained HTML page of tables and figures."""

from __future__ import annotations

import base64
import io
import os
from pathlib import Path
from typing import Any

import xarray as xr

from hipuq import schema
from hipuq.errors import StoreError
from hipuq.report import comparison as methods
from hipuq.report.comparison_winner import winner_words
from hipuq.report.csv import csv_text
from hipuq.report.damping import label
from hipuq.report.figures import pictures
from hipuq.report.first_part import blocks
from hipuq.report.grounds import differing
from hipuq.report.partners import comparison
from hipuq.report.reading import Reading
from hipuq.report.sensitivity import has_indices, note, remarks
from hipuq.report.summary import (
    COMPARE,
    bounded,
    comparisons,
    estimates,
    headline,
    inputs_table,
    integrated,
    tables,
    trust,
)
from hipuq.report.sweeps import assumed_words, sweep_table

RESOLUTION = 130
"""Dots per inch of the pictures."""

BROAD = 8.5
"""Width [inch] above which a picture of the first part stands by itself."""

WIDE = 10.5
"""Width [inch] above which a picture is shown larger where the screen is small."""


def write_report(tree: xr.DataTree, folder: str | os.PathLike[str]) -> Path:
    """Write the figures and the report of a results tree.

    Parameters
    ----------
    tree : DataTree
        As from `hipuq.run_study` or `hipuq.load_results`.
    folder : path
        Gets ``figures/<analysis>-<figure>.png``, ``figures/compare-<problem>-<figure>.png`` and
        ``report.html``.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    import jinja2

    target = Path(folder)
    try:
        (target / "figures").mkdir(parents=True, exist_ok=True)
        images: dict[str, list[dict[str, str]]] = {}
        for picture in pictures(tree):
            buffer = io.BytesIO()
            picture.figure.savefig(buffer, format="png", dpi=RESOLUTION)
            name = f"{picture.analysis.replace('/', '-')}-{picture.name}.png"
            (target / "figures" / name).write_bytes(buffer.getvalue())
            data = base64.b64encode(buffer.getvalue()).decode("ascii")
            width = picture.figure.get_figwidth()
            kind = "wide" if width > WIDE else "broad" if width > BROAD else ""
            image = {"data": data, "caption": picture.caption, "kind": kind}
            images.setdefault(f"#{picture.block}" if picture.block else picture.analysis, []).append(image)
        environment = jinja2.Environment(
            loader=jinja2.PackageLoader("hipuq.report", "."),
            autoescape=True,
            undefined=jinja2.StrictUndefined,
        )
        environment.filters["csv"] = csv_text
        page = environment.get_template("template.html").render(content(tree, images))
        file = target / "report.html"
        file.write_text(page, encoding="utf-8")
    except OSError as error:
        raise StoreError(f"cannot write the report to {target}: {error.strerror}") from error
    return file


def content(tree: xr.DataTree, images: dict[str, list[dict[str, str]]]) -> dict[str, Any]:
    """Return everything that the page shows.

    Parameters
    ----------
    tree : DataTree
    images : dict
        Pictures by analysis, ``compare/<problem>``, or ``#<block>`` of the first part.

    Returns
    -------
    dict
        Variables of the template.
    """
    reading = Reading(tree)
    sections = [
        section(reading, analysis) | {"images": images.get(analysis, [])}
        for analysis in reading.found
        if any(True for _ in estimates(reading.found[analysis]))
    ]
    first = [{"block": one, "images": images.get(f"#{one.key}", [])} for one in blocks(reading)]
    races = [
        {
            "name": problem,
            "label": methods.label(race),
            "lead": winner_words(race),
            "facts": methods.facts(race),
            "remarks": methods.remarks(race),
            "tables": methods.tables(race),
            "images": images.get(f"{COMPARE}/{problem}", []),
            "given": [methods.contender_table(race), inputs_table(race)],
        }
        for problem, race in comparisons(tree)
    ]
    return {
        "study": tree.attrs,
        "first": first,
        "sections": sections,
        "comparisons": races,
        "indices": any(one["indices"] for one in sections),
    }


def section(reading: Reading, analysis: str) -> dict[str, Any]:
    """Return what the page shows of an analysis, a sweep at the value that the headline assumes.

    Parameters
    ----------
    reading : Reading
    analysis : str

    Returns
    -------
    dict
        Variables of the template.
    """
    found = dict(estimates(reading.found[analysis]))
    first = next(iter(found.values()))
    given, others = differing(reading, analysis, first)
    made = [table for results in found.values() for table in tables(results, reading.mode_names)]
    return {
        "name": analysis,
        "label": label(first),
        "attrs": first.attrs,
        "trust": trust(first),
        "swept": [table for of in found if (table := sweep_table(reading, analysis, of)) is not None],
        "assumed": assumed_words(reading, analysis),
        "headlines": [line for line in map(headline, found.values()) if line],
        "note": note(first),
        "remarks": [
            f"{of}: {line}" if len(found) > 1 else line for of, one in found.items() for line in remarks(one)
        ]
        + _elsewhere(reading, analysis),
        "given": given,
        "others": others,
        "tables": made,
        "exact": schema.is_exact(first),
        "integrated": bool(integrated(first)),
        "bounded": any("probability" in one and bounded(one, "probability") for one in found.values()),
        "comparison": comparison(analysis, reading.found),
        "confidence": f"{first.attrs['confidence']:.0%}",
        "indices": any(map(has_indices, found.values())),
    }


def _elsewhere(reading: Reading, analysis: str) -> list[str]:
    """Return in sentences which figures at nominal values stand with an earlier analysis."""
    called = {"friction_sweep": "The model over friction", "mode_shapes": "Mode shapes"}
    return [
        f"{text} at nominal values: the same as of {other!r}"
        for key, text in called.items()
        if key in reading.found[analysis] and (other := reading.alike(analysis, key)) is not None
    ]
