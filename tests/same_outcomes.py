"""Outcomes held against each other without what differs from run to run."""

import xarray as xr


def plain(outcomes: xr.Dataset) -> xr.Dataset:
    """Return outcomes in memory, without history and seconds."""
    found = outcomes.load().copy()
    for key in ("history", "seconds"):
        found.attrs.pop(key)
    return found


def same(one: xr.Dataset, other: xr.Dataset) -> None:
    """Assert that outcomes are identical but for history and seconds."""
    xr.testing.assert_identical(plain(one), plain(other))
