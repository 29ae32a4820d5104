"""Matrices that cannot be a model, and what is said of them."""

from fractions import Fraction

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
    with pytest.raises(InputError, match=r"resist 1 of 6 motions by less .* nothing ever .* mechanisms=1;"):
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


def test_mechanisms_are_counted_where_a_projection_left_rounding_in_every_entry():
    stiffness, friction = (1e6 * one for one in free_chain())
    _, modes = np.linalg.eigh(stiffness)
    projected = [modes.T @ one @ modes for one in (stiffness, friction)]
    assert np.abs(projected[0][0]).min() > 0
    with pytest.raises(InputError, match="resist 1 of 6 motions"):
        from_matrices(np.ones(6), *projected)
    assert from_matrices(np.ones(6), *projected, mechanisms=1).dofs == 6


def test_soft_motions_nothing_resisted_and_parts_that_hold():
    with pytest.raises(InputError, match="only soft, reduce the matrices to modes"):
        from_matrices([1, 1], [[-1.0, 0.0], [0.0, 1e16]], NONE)
    with pytest.raises(InputError, match=r"nothing is resisted: .* zero at the nominal values"):
        from_matrices([1, 1], NONE, NONE)
    with pytest.raises(InputError, match=r"mechanisms is 2: the matrices have 2 rows"):
        from_matrices([1, 1], NONE, NONE, mechanisms=2)
    ground = {"ground": {"stiffness": [[1, 0], [0, 0]]}}
    with pytest.raises(InputError, match=r"at the nominal values .* a part does that is 0 there"):
        from_matrices([1, 1], [[1, -1], [-1, 1]], NONE, parts=ground, nominal={"ground": 0.0})


def test_numbers_of_any_kind():
    """What Python makes a double of, however large or exact it is."""
    given = [[Fraction(1, 2), 0], [0, 10**30]]
    model = from_matrices([1, 10**30], given, NONE, nominal={"friction": Fraction(1, 4)})
    assert model.base["stiffness"].tolist() == [[0.5, 0.0], [0.0, 1e30]]
    assert model.parameters["friction"].nominal == 0.25


def test_a_stiffness_that_is_not_symmetric_has_no_damping_ratio():
    model = from_matrices([1, 1], [[2.0, 0.5], [0.0, 1.0]], NONE)
    assert "damping_ratio" not in model.parameters
    rounded = np.array([[2.0, 0.5 + 1e-11], [0.5, 1.0]])
    for given, parts, of in ((rounded, None, ""), (SPRINGS, {"pad": {"stiffness": rounded}}, " of pad")):
        with pytest.raises(InputError, match=f"halves of stiffness{of} differ by 5e-12 of its largest entry"):
            from_matrices([1, 1], given, NONE, parts=parts, nominal={"damping_ratio": 0.01})
    with pytest.raises(InputError, match="damping_ratio is none where damping matrices are given"):
        from_matrices([1, 1], SPRINGS, NONE, NONE, nominal={"damping_ratio": 0.01})
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
    "objects": ({"stiffness": [[10**400, 0], [0, 1]]}, "stiffness holds object: it must hold numbers that"),
    "too long": ({"stiffness": np.diag([np.longdouble("1e400"), 1])}, "stiffness is inf in row 1, column 1"),
    "at the end": ({"mass": np.diag([1e308, 1e308])}, "mass holds a value above 1e[+]140: choose"),
    "opposite": ({"damping": [[1, -1.5e308], [1.5e308, 1]]}, "damping holds a value above 1e[+]140"),
    "masked": ({"stiffness": np.ma.masked_equal(SPRINGS, 7.75)}, "stiffness has masked entries"),
    "no mass at all": ({"mass": None}, "mass is missing: give zeros if parts hold all of it"),
    "no friction": ({"friction_stiffness": None}, "friction_stiffness is missing: give zeros"),
    "large": ({"stiffness": np.diag([1.0, 1e200])}, "choose other units"),
    "singular": ({"mass": np.ones((2, 2))}, "mass is not positive definite"),
    "no mass": ({"mass": [1.0, 0.0]}, "its eigenvalues are 0 to 1: condense"),
    "indefinite": ({"mass": [[1.0, 2.0], [2.0, 1.0]]}, "its eigenvalues are -1 to 3"),
    "triangle": ({"mass": [[1.0, 0.1], [0.0, 1.0]]}, "mass is not symmetric, its halves differ by 0.1"),
    "label": ({"label": ""}, "label is ''"),
    "lines": ({"label": "two\nlines"}, "it must be a name, in one line"),
    "threshold": ({"growth_threshold": -1.0}, "growth_threshold"),
    "parts": ({"parts": [CONTACT]}, "parts are list"),
    "part": ({"parts": {"pad": None}}, "part 'pad' has no matrices"),
    "part of None": ({"parts": {"pad": {"stiffness": None}}}, "stiffness of pad is None: leave it out"),
    "no part": ({"parts": {"pad": {}}}, "part 'pad' has no matrices"),
    "part's shape": ({"parts": {"pad": {"stiffness": np.eye(3)}}}, "stiffness of pad has 3 rows"),
    "part's mass": ({"parts": {"pad": {"mass": [[0, 1], [0, 0]]}}}, "mass of pad is not symmetric"),
    "no name": ({"parts": {"left pad": CONTACT}}, "'left pad'"),
    "nominal": ({"nominal": {"friction": "a lot"}}, "nominal friction is 'a lot'"),
    "nominal list": ({"nominal": [0.5]}, "nominal is list: it must map parameters to numbers"),
    "nominal text": ({"nominal": "friction"}, "nominal is str"),
    "nominal complex": ({"nominal": {"friction": np.complex128(1j)}}, "friction is .*1j.*: it must be one"),
    "nominal large": ({"nominal": {"friction": 10**400}}, "nominal friction does not fit a double"),
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


TAKEN = (
    *("friction", "damping_ratio", "contact_stiffness", "margin", "sample", "status"),
    *("failure_message", "failed_sample", "seconds", "failed", "undecided", "evaluations"),
)


@pytest.mark.parametrize("name", TAKEN)
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


@pytest.mark.parametrize(("added", "mass"), [([[1, 1], [1, 1]], "matrix is not"), ([1, 1], "it is -9.0")])
@pytest.mark.parametrize("damping", ["damping_ratio", "mass_damping"])
def test_a_mass_that_a_sample_makes_indefinite_is_named_before_its_damping(added, mass, damping):
    model = from_matrices(np.eye(2), SPRINGS, NONE, parts={"added": {"mass": added}})
    with pytest.raises(InputError, match=f"^mass.* {mass}"):
        model(model.nominal(added=[0.0, -10.0], **{damping: 0.01}))
