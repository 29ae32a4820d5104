"""Figures against pictures of them: shapes, colours and hatches, without what is written.

Versions of matplotlib lay text out differently, so all of it is taken away and Axes are put in fixed
places. `python tests/test_plots_images.py` draws the pictures anew; look at them before they are kept.
"""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.testing.compare import compare_images
from plot_results import by_mode, literature, on_grid, patterns, swept

from hipuq import plots

IMAGES = Path(__file__).parent / "images"

TOLERANCE = 2.0
"""Root mean square of the difference, of 255."""


def probability_over(ax):
    curves = {"a": swept([0.9, 0.6, np.nan, 0.1, 0.0]), "b": swept(0.5 * np.linspace(1, 0, 5) ** 2, 0.05)}
    plots.probability_over(curves, literature=literature([0.027, 0.209]), ax=ax)


def boxplots(ax):
    plots.boxplots(by_mode(seed=2, oscillators=5, counts=(2, 3, 4, 5)), ax=ax)


def pattern_map(ax):
    results = patterns(oscillators=6, counts=(4, 5, 6))
    results["probability"][3] = np.nan
    plots.pattern_map(results, ax=ax)


def stability_map(ax):
    x, y = np.meshgrid(np.linspace(0, 1, 12), np.linspace(0, 1, 9))
    values = (x**2 > y).astype(float)
    values[2:4, 5:7] = np.nan
    plots.stability_map(on_grid(values), "friction", "damping_ratio", ax=ax)


FIGURES = {one.__name__: one for one in (probability_over, boxplots, pattern_map, stability_map)}


def picture(name, path):
    """Draw a figure without its words."""
    figure = Figure(figsize=(4.8, 3.2), dpi=80)
    FIGURES[name](figure.add_axes((0.03, 0.03, 0.82, 0.94)))
    places = [(0.03, 0.03, 0.82, 0.94), (0.9, 0.03, 0.05, 0.94)]
    for ax, place in zip(figure.axes, places, strict=False):
        ax.set_axes_locator(None)
        ax.set_position(place)
        if ax.get_legend() is not None:
            ax.get_legend().remove()
        for text in list(ax.texts):
            text.remove()
        ax.set(title="", xlabel="", ylabel="")
        ax.tick_params(which="both", labelleft=False, labelright=False, labelbottom=False, length=0)
    figure.savefig(path)


@pytest.mark.parametrize("name", FIGURES)
def test_picture(name, tmp_path):
    here = tmp_path / f"{name}.png"
    picture(name, here)
    assert compare_images(str(IMAGES / here.name), str(here), tol=TOLERANCE) is None


if __name__ == "__main__":
    IMAGES.mkdir(exist_ok=True)
    for name in FIGURES:
        picture(name, IMAGES / f"{name}.png")
