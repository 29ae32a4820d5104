"""Study files: study.toml -> `Study`, checked as a whole -> run.

A study names models, their uncertain inputs, and what is done with them: analyses, and comparisons of
methods on problems with a known answer. Names, types and options are checked when it is loaded. Whether
results have what is compared shows only in results: so each contender of each problem runs once, in its
smallest size, before anything else is computed. The results of an analysis are on disk before the next one
begins, those of a comparison run by run, so that a study that was cut off can go on.
"""

from hipuq.study.plan import Analysis, Study, load_study
from hipuq.study.problems import Problem
from hipuq.study.resuming import would_keep
from hipuq.study.running import run_study

__all__ = ["Analysis", "Problem", "Study", "load_study", "run_study", "would_keep"]
