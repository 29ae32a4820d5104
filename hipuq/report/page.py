"""One self-contained HTML page of tables and figures."""

from __future__ import annotations

import base64
import io
import json
import os
from pathlib import Path
from typing import Any

import xarray as xr

from hipuq import schema
from hipuq.errors import StoreError
from hipuq.report import comparison as methods
from hipuq.report.comparison_winner import winner_words
from hipuq.report.figures import pictures
from hipuq.report.partners import comparison, groups_of
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

RESOLUTION = 130
"""Dots per inch of the pictures."""

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
            kind = "wide" if picture.figure.get_figwidth() > WIDE else ""
            image = {"data": data, "caption": picture.caption, "kind": kind}
            images.setdefault(picture.analysis, []).append(image)
        environment = jinja2.Environment(
            loader=jinja2.PackageLoader("hipuq.report", "."),
            autoescape=True,
            undefined=jinja2.StrictUndefined,
        )
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
        Pictures by analysis, or ``compare/<problem>``.

    Returns
    -------
    dict
        Variables of the template.
    """
    names = json.loads(tree.attrs.get("report", "{}")).get("mode_names", {})
    sections, indices = [], False
    groups = groups_of(tree)
    for analysis in groups:
        found = dict(estimates(tree, analysis))
        if not found:
            continue
        indices = indices or any(map(has_indices, found.values()))
        first = next(iter(found.values()))
        sections.append(
            {
                "name": analysis,
                "attrs": first.attrs,
                "trust": trust(first),
                "headlines": [line for line in map(headline, found.values()) if line],
                "note": note(first),
                "remarks": [
                    f"{of}: {line}" if len(found) > 1 else line
                    for of, one in found.items()
                    for line in remarks(one)
                ],
                "inputs": inputs_table(first),
                "tables": [table for results in found.values() for table in tables(results, names)],
                "images": images.get(analysis, []),
                "exact": schema.is_exact(first),
                "integrated": bool(integrated(first)),
                "bounded": any(
                    "probability" in one and bounded(one, "probability") for one in found.values()
                ),
                "comparison": comparison(analysis, groups),
                "confidence": f"{first.attrs['confidence']:.0%}",
            }
        )
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
    return {"study": tree.attrs, "sections": sections, "comparisons": races, "indices": indices}
