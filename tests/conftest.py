"""Settings of the tests: helper modules beside them can be imported, property tests repeat exactly."""

import gc
import sys
from pathlib import Path

from hypothesis import settings

# pytest runs with import mode "importlib", which leaves sys.path alone.
sys.path.insert(0, str(Path(__file__).parent))

# Derandomised: a failure in one run is a failure in every run. No database: no files left behind.
settings.register_profile("hipuq", deadline=None, max_examples=50, derandomize=True, database=None)
settings.load_profile("hipuq")


def pytest_collection_finish(session):
    """Have the garbage collector come less often: it is dear where so much is loaded."""
    gc.set_threshold(100_000)
