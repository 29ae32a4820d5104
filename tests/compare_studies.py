"""Study files that compare methods, small ones: what several tests need."""

COMPARE = """
title = "Compared"
seed = 5

[compare]
budgets = [16, 32]
replicates = 3
of = "any_unstable"

[compare.contenders.random]
method = "monte_carlo"
[compare.contenders."latin hypercube"]
method = "monte_carlo"
options = { sampler = "latin_hypercube", replicates = 4 }
[compare.contenders.integrated]
method = "monte_carlo"
integrate_friction = true
budgets = [32]
replicates = 2
[compare.contenders.sobol]
method = "sobol"
options = { resamples = 20 }

[[compare.problem]]
name = "hoffmann"
title = "Scattered contact stiffness"
contenders = ["random", "latin hypercube", "integrated"]
reference = 0.402
source = "by hand"
baseline = "latin hypercube"
[compare.problem.model]
name = "two_dof"
preset = "hoffmann2002"
[compare.problem.inputs.friction]
distribution = "uniform"
lower = 0.0
upper = 0.8
[compare.problem.inputs.k3]
distribution = "uniform"
lower = -0.1
upper = 0.1
apply = "relative"

[[compare.problem]]
name = "indices"
contenders = ["sobol"]
budgets = [64]
replicates = 2
of = "margin"
quantity = "ST"
reference = { friction = 0.9, k3 = 0.2 }
model = { name = "two_dof" }
[compare.problem.inputs.friction]
distribution = "uniform"
lower = 0.0
upper = 0.8
[compare.problem.inputs.k3]
distribution = "uniform"
lower = -0.1
upper = 0.1
apply = "relative"

[[compare.problem]]
name = "onset"
contenders = ["random"]
reference = { exact = true }
model = { name = "two_dof" }
[compare.problem.inputs.friction]
distribution = "uniform"
lower = 0.0
upper = 0.8
"""
"""Three problems with models of their own: a number, one by parameter, an exact one as reference."""

ANALYSES = """
[model]
name = "two_dof"
preset = "hoffmann2002"
[inputs.friction]
distribution = "uniform"
lower = 0.0
upper = 0.8
[inputs.k3]
distribution = "uniform"
lower = -0.1
upper = 0.1
apply = "relative"
[[analysis]]
name = "a"
method = "monte_carlo"
n = 24
of = ["any_unstable", "margin"]
[[analysis]]
name = "b"
method = "monte_carlo"
n = 32
of = "margin"
options = { sampler = "latin_hypercube" }
model = { k1 = 12.0 }
"""
"""Model, inputs and two analyses, for a study with a title."""

BOTH = COMPARE + ANALYSES
