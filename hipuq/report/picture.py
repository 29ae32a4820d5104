"""A figure of a report."""

from __future__ import annotations

from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure


@dataclass(frozen=True)
class Picture:
    """A figure of a report.

    Attributes
    ----------
    analysis : str
        The analysis that it belongs to, or ``compare/<problem>``.
    name : str
        Name of its file.
    caption : str
        What it shows, in a sentence or two.
    figure : Figure
    block : str
        Key of the block of the first part that it stands in; empty where it stands with its analysis.
    """

    analysis: str
    name: str
    caption: str
    figure: Figure
    block: str = ""


def figure_of(ax: Axes) -> Figure:
    """Return the figure that Axes stand on."""
    figure = ax.figure
    assert isinstance(figure, Figure)
    return figure
