"""Versions of what numbers depend on."""

from __future__ import annotations

import platform
from contextlib import suppress
from importlib import metadata

from hipuq.compiled.binding import kernel_name

PACKAGES = ("hipuq", "numpy", "scipy", "xarray", "chaospy", "SALib", "python-flint")
"""Packages that numbers depend on."""


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that numbers depend on, and the eigenvalue kernel."""
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            found[name] = metadata.version(name)
    return found | {"kernel": kernel_name()}
