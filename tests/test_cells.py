"""Cells of friction between boundaries: what a search has missed is noticed, odd pencils end."""

import chaospy as cp
import numpy as np
import pytest

import hipuq
from hipuq.cea import Pencils, cells
from hipuq.cea.cells import stability_cells


def pencils(constant, slope):
    """Return one pencil of unit mass."""
    n = len(constant)
    return Pencils(
        mass=np.ones((1, n)),
        stiffness=np.asarray(constant, float)[None],
        friction_stiffness=np.asarray(slope, float)[None],
        friction=np.zeros(1),
        damping=None,
        mechanisms=np.zeros(1, int),
    )


@pytest.mark.parametrize("place", np.linspace(0.1, 0.9, 17))
def test_a_missed_window_of_instability_is_noticed(monkeypatch, place):
    """Two roots meet in a window of 5 % of the range, and the search is made to find nothing."""
    coupling = 0.05 / 4
    constant = np.diag([2.0 - place, 2.0, 9.0])
    constant[0, 1], constant[1, 0] = coupling, -coupling
    case = pencils(constant, np.diag([1.0, 0.0, 0.0]))
    assert stability_cells(case, 0.0, 1.0, by_mode=True)[0].count.tolist() == [0, 1, 0]
    monkeypatch.setattr(cells, "_all_boundaries", lambda *_: ([()], [np.empty((0, 2))]))
    assert np.isnan(stability_cells(case, 0.0, 1.0, by_mode=True)[0].count).any()


def test_a_triple_root_at_the_end_of_the_range():
    slope = [[0.0, 1.0, 2.0], [-1.0, 0.0, 0.5], [-2.0, -0.5, 0.0]]
    for by_mode in (True, False):
        found = stability_cells(pencils(2 * np.eye(3), slope), 0.0, 1.0, by_mode=by_mode)[0]
        # One pair parts from the real line at once; what is not proved of it is not known.
        assert (np.isnan(found.count) | (found.count == 1)).all()


@pytest.mark.parametrize("width", [4e-8, 1e-7])
def test_an_overtaking_in_a_range_of_little_more_than_rounding(width):
    model = hipuq.models.ring("oberst2016-calibrated")
    place = 0.053344063
    integrated = hipuq.integrate_friction(model, cp.Uniform(place - 0.45 * width, place + 0.5 * width))
    outcomes = integrated(integrated.nominal())
    assert outcomes["probability"].item() == pytest.approx(1.0)
