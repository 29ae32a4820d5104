"""What is on Axes and whether it fits: what figures of indices are tested with."""

import numpy as np
from index_results import ELEMENTS, sobol


def drawn(ax):
    """Draw the whole figure, which runs the layout: a warning there is an error, as in all tests."""
    ax.figure.draw_without_rendering()
    return ax


def labels(ax):
    return ax.get_legend_handles_labels()[1]


def texts(ax):
    return [text.get_text() for text in ax.texts]


def assert_inside(ax):
    """Assert that nothing that is written reaches beyond the figure."""
    box, page = drawn(ax).get_tightbbox(), ax.figure.bbox
    assert page.x0 - 1 <= box.x0
    assert box.x1 <= page.x1 + 1
    assert page.y0 - 1 <= box.y0
    assert box.y1 <= page.y1 + 1


def elements(count=40, width=0.01):
    total = np.linspace(0.3, 0.0, count)
    return sobol(ELEMENTS[:count], total / 3 - 0.004, total, width=width)
