"""Pages of the documentation are tests too: their blocks of code run, see docs/examples.py."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "docs"))

collect_ignore_glob = ["docs/*.py", "docs/*/*.py"]  # programs, not modules with examples


def pytest_collect_file(file_path, parent):
    """Collect the blocks of a page."""
    if file_path.suffix != ".md":
        return None
    from examples import pages

    return pages.pytest()(file_path, parent)
