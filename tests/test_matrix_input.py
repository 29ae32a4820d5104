"""Matrices that cannot be a model, and what is said of them."""

import chaospy as cp
import numpy as np
import pytest
from test_matrices import CONTACT, NONE, SPRINGS, hoffmann

import hipuq
from hipuq import schema
from hipuq.errors import InputError, UnknownNameError
from hipuq.models import from_matrices


def free_chain(n: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """Return the stiffness of masses in a row that nothing holds, and a friction within."""
    pulls = np.diff(np.eye(n), axis=0)
    return pulls.T @ np.diag(np.arange(2.0, n + 1)) @ pulls, -np.outer(pulls[3] + pulls[1], pulls[2])


def test_mechanisms():
    """Too few are refused, too many leave everything unknown, as many as there are give verdicts."""
    stiffness, friction = free_chain()
    mass = np.linspace(0.7, 1.9, 6)
    with pytest.raises(InputError, match="resist 1 motions by rounding only, and mechanisms is 0"):
        from_matrices(mass, stiffness, friction)
    model = from_matrices(mass, stiffness, friction, mechanisms=1)
    outcomes = model(model.nominal(friction=[0.0, 0.5], damping_ratio=[0.01, 0.0]))
    assert (outcomes["status"] == 0).all()
    assert (outcomes["frequency"][:, 0] == 0).all()
    model = from_matrices(mass, stiffness, friction, mechanisms=2)
    outcomes = model(model.nominal(friction=[0.0, 0.5]))
    assert (outcomes["status"] == schema.STATUS["undecided"]).all()
    for wrong in (-1, 6, 1.0, True):
        with pytest.raises(InputError, match="mechanisms"):
            from_matrices(mass, stiffness, friction, mechanisms=wrong)


def test_a_stiffness_that_is_not_symmetric_has_no_damping_ratio():
    model = from_matrices([1, 1], [[2.0, 0.5], [0.0, 1.0]], NONE)
    assert "damping_ratio" not in model.parameters
    damped = model(model.nominal(mass_damping=0.1, stiffness_damping=0.01))
    np.testing.assert_allclose(damped["growth_rate"][0], [-0.055, -0.06], rtol=1e-9)


BAD = {
    "shape": ({"stiffness": np.ones((2, 3))}, r"stiffness has the shape \(2, 3\)"),
    "vector": ({"stiffness": [1.0, 2.0]}, r"stiffness has the shape \(2,\)"),
    "empty": ({"mass": [], "stiffness": np.zeros((0, 0))}, "stiffness has the shape"),
    "ragged": ({"friction_stiffness": [[1.0], [1.0, 2.0]]}, "friction_stiffness is no matrix"),
    "sizes": ({"mass": [1.0, 1.0, 1.0]}, "mass has 3 rows, stiffness has 2"),
    "nan": ({"stiffness": [[1.0, np.nan], [0.0, 1.0]]}, "stiffness is nan in row 1, column 2"),
    "infinite": ({"damping": [[1.0, 0.0], [-np.inf, 1.0]]}, "damping is -inf in row 2, column 1"),
    "complex": ({"stiffness": np.eye(2) * (1 + 0.01j)}, "stiffness is complex"),
    "text": ({"stiffness": [["a", "b"], ["c", "d"]]}, "it must hold numbers"),
    "large": ({"stiffness": np.diag([1.0, 1e200])}, "choose other units"),
    "singular": ({"mass": np.ones((2, 2))}, "mass is not positive definite"),
    "no mass": ({"mass": [1.0, 0.0]}, "its eigenvalues are 0 to 1: condense"),
    "indefinite": ({"mass": [[1.0, 2.0], [2.0, 1.0]]}, "its eigenvalues are -1 to 3"),
    "triangle": ({"mass": [[1.0, 0.1], [0.0, 1.0]]}, "mass is not symmetric, its halves differ by 0.1"),
    "label": ({"label": ""}, "label is ''"),
    "threshold": ({"growth_threshold": -1.0}, "growth_threshold"),
    "parts": ({"parts": [CONTACT]}, "parts are list"),
    "part": ({"parts": {"pad": None}}, "part 'pad' has no matrices"),
    "no part": ({"parts": {"pad": {}}}, "part 'pad' has no matrices"),
    "part's shape": ({"parts": {"pad": {"stiffness": np.eye(3)}}}, "stiffness of pad has 3 rows"),
    "part's mass": ({"parts": {"pad": {"mass": [[0, 1], [0, 0]]}}}, "mass of pad is not symmetric"),
    "no name": ({"parts": {"left pad": CONTACT}}, "'left pad'"),
    "nominal": ({"nominal": {"friction": "a lot"}}, "nominal friction is 'a lot'"),
    "nominal nan": ({"nominal": {"friction": np.nan}}, "friction is nan"),
    "negative": ({"nominal": {"damping_ratio": -0.1}}, "damping_ratio is -0.1"),
}


@pytest.mark.parametrize("case", BAD)
def test_refused(case):
    wrong, message = BAD[case]
    given = {"mass": [1.0, 1.0], "stiffness": SPRINGS, "friction_stiffness": NONE} | wrong
    with pytest.raises(InputError, match=message) as caught:
        from_matrices(**given)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "name", ["friction", "damping_ratio", "contact_stiffness", "margin", "sample", "status"]
)
def test_names_that_are_taken(name):
    with pytest.raises(InputError, match=f"called '{name}', which means something else"):
        from_matrices([1, 1], SPRINGS, NONE, parts={name: CONTACT})


def test_unknown_names():
    with pytest.raises(UnknownNameError, match="did you mean 'stiffness'"):
        from_matrices([1, 1], SPRINGS, NONE, parts={"pad": {"stifness": SPRINGS}})
    with pytest.raises(UnknownNameError, match="did you mean 'contact_factor'"):
        hoffmann(nominal={"contact_facto": 1.0})
    with pytest.raises(UnknownNameError, match="did you mean 'contact_factor'"):
        hoffmann().inputs(contact_facto=cp.Uniform(0, 1))
    with pytest.raises(UnknownNameError, match="'always'"):
        hoffmann(certify="alway")


def test_a_mass_that_a_sample_makes_indefinite_fails_alone():
    model = from_matrices(np.eye(2), SPRINGS, NONE, parts={"added": {"mass": [[0.1, 0.1], [0.1, 0.1]]}})
    samples = model.nominal(added=[0.0, -100.0, 1.0])
    outcomes = hipuq.evaluate(model, samples, progress=False)
    assert outcomes["status"].values.tolist() == [0, schema.STATUS["failed"], 0]
    assert "positive definite" in str(outcomes["failure_message"].values[0])
