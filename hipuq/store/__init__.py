"""Files: results in netCDF, outcomes in Zarr."""

from hipuq.store.outcomes import load_outcomes, save_outcomes
from hipuq.store.results import RESULTS_NAME, add_results, check_ours, load_results, save_results
from hipuq.store.versions import versions

__all__ = [
    "RESULTS_NAME",
    "add_results",
    "check_ours",
    "load_outcomes",
    "load_results",
    "save_outcomes",
    "save_results",
    "versions",
]
