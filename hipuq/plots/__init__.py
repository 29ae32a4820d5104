"""Figures: one function each, Dataset in, matplotlib Axes out.

A figure is drawn on the Axes given as ``ax=`` (``axes=``, ``figure=`` where there are several), else
on those of a new figure, which pyplot does not know: ``ax.figure.savefig(...)`` writes it.

================================  ==========================================  ============================
function                          shows                                       takes
================================  ==========================================  ============================
`probability_over`                probability of instability over a           results of `hipuq.sweep`
                                  parameter, such as the damping ratio
`stability_map`                   probability or stability over two           the same, or outcomes on a
                                  parameters, with the border                 grid
`by_count`                        probability for each number in contact      stratified results of
                                                                              ``any_unstable``
`pattern_map`                     which oscillators each contact pattern has  the same
                                  in contact, by probability
`occurrence`                      how often each mode is unstable, over the   stratified results of
                                  patterns of a number in contact             ``unstable``
`occurrence_panels`               the same for every number in contact        the same
`boxplots`                        boxes of the patterns, for each mode and    the same
                                  number in contact
`mode_frequencies`                at which frequencies modes are unstable,    results of
                                  beside measured squeak                      `hipuq.frequency_ranges`
`fragility`                       probability of instability over friction    results of `hipuq.fragility`
`onset_distribution`              share of configurations with an onset,      outcomes with ``onset``
                                  over friction
`mode_shape`                      a mode of the ring, deformed                mode shapes of a ring
`frequency_over_friction`         frequencies of modes, with lock-in          friction sweep
`growth_over_friction`            growth rates of modes, with lock-in         friction sweep
`lock_in`                         both, for pairs of modes                    friction sweep
`dispersion`                      real and imaginary parts of all modes       friction sweep
`root_locus`                      growth rate over frequency                  friction sweep
`damping_over_frequency`          damping ratio over frequency                friction sweep
`index_bars`                      first- and total-order index of each        results with ``S1``, ``ST``
                                  parameter
`second_order`                    second-order index of each pair of          results with ``S2``
                                  parameters
`convergence`                     an estimate over the evaluations used       results of ``_by_budget``
`predicted_against_true`          a surrogate against the model, on           results of ``chaos``
                                  held-out samples
`error_over_cost`                 error of methods over evaluations or time   results of `hipuq.compare`
`coverage`                        how many intervals of methods hold the      the same
                                  answer
`cost_of_accuracy`                time of methods by that of the baseline     the same
                                  for the same error
================================  ==========================================  ============================

A friction sweep is ``evaluate(model, model.nominal(friction=np.linspace(0, 0.1, 1001)))``;
`follow_modes` follows modes through one, `lock_in_bracket` reads off where a mode locks in.
"""

from hipuq.plots.boxes import boxplots
from hipuq.plots.comparison import cost_of_accuracy, coverage, error_over_cost
from hipuq.plots.convergence import convergence
from hipuq.plots.counts import by_count
from hipuq.plots.eigenvalue_plane import damping_over_frequency, root_locus
from hipuq.plots.fragility_curves import fragility
from hipuq.plots.friction_sweep import dispersion, frequency_over_friction, growth_over_friction, lock_in
from hipuq.plots.indices import index_bars, second_order
from hipuq.plots.maps import stability_map
from hipuq.plots.mode_shapes import mode_shape
from hipuq.plots.occurrences import occurrence, occurrence_panels
from hipuq.plots.onsets import onset_distribution
from hipuq.plots.patterns import pattern_map
from hipuq.plots.squeak import mode_frequencies
from hipuq.plots.surrogate import predicted_against_true
from hipuq.plots.swept import probability_over
from hipuq.plots.tracking import follow_modes, lock_in_bracket

__all__ = [
    "probability_over",
    "stability_map",
    "by_count",
    "pattern_map",
    "occurrence",
    "occurrence_panels",
    "boxplots",
    "mode_frequencies",
    "fragility",
    "onset_distribution",
    "mode_shape",
    "frequency_over_friction",
    "growth_over_friction",
    "lock_in",
    "dispersion",
    "root_locus",
    "damping_over_frequency",
    "index_bars",
    "second_order",
    "convergence",
    "predicted_against_true",
    "error_over_cost",
    "coverage",
    "cost_of_accuracy",
    "follow_modes",
    "lock_in_bracket",
]
