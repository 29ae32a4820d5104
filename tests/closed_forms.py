"""Probabilities and Sobol indices of the mode-coupling models in closed form: known answers for methods.

Both models have two degrees of freedom and are unstable above one onset of friction mu_0, which depends on
what else is uncertain, x. With friction U(lower, upper) and lower <= mu_0(x) <= upper for all x,

    P(unstable | x) = (upper - mu_0(x)) / (upper - lower),    P = (upper - E mu_0) / (upper - lower).

Hoffmann et al. (2002): K = [[k11, k12 - mu k3], [k12, k22]] with unit mass has complex squared frequencies
where (k11 - k22)^2 / 4 + k12 (k12 - mu k3) < 0. Springs at 150 and 30 deg have sin^2 = 1/4, cos^2 = 3/4 and
sin cos = -+ sqrt(3)/4, so k11 - k22 = (k1 + k2) / 2 - k3, k12 = sqrt(3)/4 (k2 - k1), and the onset is

    mu_c(k3) = (k12^2 + (h - k3)^2 / 4) / (k12 k3) = alpha / k3 + beta + gamma k3,    h = (k1 + k2) / 2,
    alpha = (k12^2 + h^2 / 4) / k12,    beta = -h / (2 k12),    gamma = 1 / (4 k12).

Hulten (1993), undamped: K = [[w1^2, -mu w2^2], [mu w1^2, w2^2]] has them where (w1^2 - w2^2)^2 is below
4 mu^2 w1^2 w2^2, so the onset is mu_0 = |w1^2 - w2^2| / (2 w1 w2) = (f1 / f2 - f2 / f1) / 2 for f1 > f2.
"""

from dataclasses import dataclass, field

import chaospy as cp
import numpy as np

import hipuq

K1, K2, K3 = 11.0, 20.0, 11.0
"""Stiffnesses of the preset hoffmann2002 [N/m], springs at 150 and 30 deg."""

K12 = np.sqrt(3) / 4 * (K2 - K1)
HALF = (K1 + K2) / 2
ALPHA, BETA, GAMMA = (K12**2 + HALF**2 / 4) / K12, -HALF / (2 * K12), 1 / (4 * K12)


@dataclass(frozen=True)
class Answer:
    """A problem and its exact answer.

    Attributes
    ----------
    model : CEAModel
    inputs : Inputs
    probability : float
        That any mode is unstable.
    friction : object
        Distribution of friction; None where it is fixed.
    first, total : dict of float
        Sobol indices of the verdict by parameter, where there is a closed form.
    """

    model: hipuq.models.CEAModel
    inputs: hipuq.Inputs
    probability: float
    friction: object = None
    first: dict[str, float] = field(default_factory=dict)
    total: dict[str, float] = field(default_factory=dict)

    def integrated(self):
        """Return the model with friction integrated, and its inputs."""
        model = hipuq.integrate_friction(self.model, self.friction)
        return model, self.inputs.without("friction")


def onset_hoffmann(k3):
    """Return mu_c of contact stiffnesses k3 [N/m]."""
    return ALPHA / k3 + BETA + GAMMA * k3


def onset_hulten(f1, f2=75.0):
    """Return mu_0 of natural frequencies f1 > f2 [Hz]."""
    return (f1 / f2 - f2 / f1) / 2


def hoffmann(upper=0.8):
    """Return hoffmann2002 with friction U(0, upper) alone: P = 1 - mu_c / upper."""
    model = hipuq.models.two_dof("hoffmann2002")
    friction = cp.Uniform(0.0, upper)
    return Answer(model, model.inputs(friction=friction), 1 - onset_hoffmann(K3) / upper, friction)


def hoffmann_scattered(upper=0.8, scatter=0.1):
    """Return hoffmann2002 with friction U(0, upper) and k3 U(a, b), 10 % to either side.

    With E k3 = m and E 1/k3 = ln(b / a) / (b - a) = l:  P = 1 - (alpha l + beta + gamma m) / upper.

    First-order index of k3: Var P(unstable | k3) = Var mu_c / upper^2, and
    Var mu_c = alpha^2 (1/(a b) - l^2) + gamma^2 (b - a)^2 / 12 + 2 alpha gamma (1 - l m).

    First-order index of friction: mu_c falls with k3 up to sqrt(alpha / gamma) = 17.3 > b, so
    P(unstable | mu) is 0 below mu_c(b), 1 above mu_c(a), and between, at mu = mu_c(k), (b - k) / (b - a).
    There -d mu = (alpha / k^2 - gamma) dk, so

        upper E P(unstable | mu)^2 = int_a^b ((b - k) / (b - a))^2 (alpha / k^2 - gamma) dk + upper - mu_c(a),

    with int_a^b (b - k)^2 / k^2 dk = b^2 (1/a - 1/b) - 2 b ln(b / a) + b - a and
    int_a^b (b - k)^2 dk = (b - a)^3 / 3.
    Two inputs interact with nothing but each other: the total index of one is 1 less the first of the other.
    """
    a, b = K3 * (1 - scatter), K3 * (1 + scatter)
    width, m, inverse = b - a, (a + b) / 2, np.log(b / a) / (b - a)
    assert 0 < onset_hoffmann(b) < onset_hoffmann(a) < upper and b < np.sqrt(ALPHA / GAMMA)
    p = 1 - (ALPHA * inverse + BETA + GAMMA * m) / upper
    scatter_of_onset = (
        ALPHA**2 * (1 / (a * b) - inverse**2)
        + GAMMA**2 * width**2 / 12
        + 2 * ALPHA * GAMMA * (1 - inverse * m)
    )
    ramp = ALPHA * (b**2 * (1 / a - 1 / b) - 2 * b * np.log(b / a) + width) - GAMMA * width**3 / 3
    squares = (ramp / width**2 + upper - onset_hoffmann(a)) / upper
    first = {
        "friction": (squares - p**2) / (p * (1 - p)),
        "k3": scatter_of_onset / upper**2 / (p * (1 - p)),
    }
    total = {"friction": 1 - first["k3"], "k3": 1 - first["friction"]}
    model, friction = hipuq.models.two_dof("hoffmann2002"), cp.Uniform(0.0, upper)
    k3 = hipuq.relative(cp.Uniform(-scatter, scatter))
    return Answer(model, model.inputs(friction=friction, k3=k3), p, friction, first, total)


def hulten():
    """Return the undamped hulten with friction 0.3, f2 = 75 Hz and f1 U(90, 110) Hz.

    It is unstable below the f1 at which mu_0 is the friction mu: f1 = f2 (mu + sqrt(mu^2 + 1)).
    """
    model = hipuq.models.two_dof("hulten", friction=0.3, frequency_2=75.0)
    p = (75 * (0.3 + np.sqrt(1 + 0.3**2)) - 90) / 20
    return Answer(model, model.inputs(frequency_1=cp.Uniform(90.0, 110.0)), p)


def hulten_scattered():
    """Return the undamped hulten with friction U(0.1, 0.5), f2 = 75 Hz and f1 U(90, 110) Hz.

    2 E mu_0 = E f1 / f2 - f2 E 1/f1 with E f1 = 100 and E 1/f1 = ln(110 / 90) / 20. The onset rises with f1
    from 0.18 to 0.39: it stays within the friction that occurs.
    """
    model, friction = hipuq.models.two_dof("hulten", frequency_2=75.0), cp.Uniform(0.1, 0.5)
    assert 0.1 < onset_hulten(90.0) < onset_hulten(110.0) < 0.5
    onset = (100 / 75 - 75 * np.log(110 / 90) / 20) / 2
    inputs = model.inputs(friction=friction, frequency_1=cp.Uniform(90.0, 110.0))
    return Answer(model, inputs, (0.5 - onset) / 0.4, friction)


def hulten_three():
    """Return the undamped hulten with friction U(0.1, 0.5), f1 U(90, 110) Hz and f2 U(70, 80) Hz.

    2 E mu_0 = E f1 E 1/f2 - E f2 E 1/f1; the onset lies between 0.12 and 0.47.
    """
    model, friction = hipuq.models.two_dof("hulten"), cp.Uniform(0.1, 0.5)
    assert 0.1 < onset_hulten(90.0, 80.0) < onset_hulten(110.0, 70.0) < 0.5
    onset = (100 * np.log(80 / 70) / 10 - 75 * np.log(110 / 90) / 20) / 2
    inputs = model.inputs(
        friction=friction, frequency_1=cp.Uniform(90.0, 110.0), frequency_2=cp.Uniform(70.0, 80.0)
    )
    return Answer(model, inputs, (0.5 - onset) / 0.4, friction)


ANSWERS = {
    "hoffmann": hoffmann,
    "hoffmann scattered": hoffmann_scattered,
    "hulten": hulten,
    "hulten scattered": hulten_scattered,
    "hulten three": hulten_three,
}
"""All of them, by name."""
