"""Where two definitions differ, in words: for refusals that say why."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_NOTHING = object()


def difference(here: Any, there: Any, place: str = "") -> tuple[str, str, str] | None:
    """Return the first place at which two JSON values differ, and what each of them has there.

    Parameters
    ----------
    here, there : object
        As `json.loads` gives them. The order of keys does not matter.
    place : str
        Of both in something larger.

    Returns
    -------
    (str, str, str) or None
        Place such as ``"nominal.mass[2]"``, and both values as text; None where they are the same.

    Examples
    --------
    >>> difference({"n": 1, "of": ["a"]}, {"n": 1, "of": ["b"]})
    ('of[1]', "'a'", "'b'")
    """
    if isinstance(here, Mapping) and isinstance(there, Mapping):
        for key in (*here, *(key for key in there if key not in here)):
            pair = here.get(key, _NOTHING), there.get(key, _NOTHING)
            found = difference(*pair, f"{place}.{key}" if place else str(key))
            if found is not None:
                return found
        return None
    if isinstance(here, list) and isinstance(there, list) and len(here) == len(there):
        for number, pair in enumerate(zip(here, there, strict=True), 1):
            found = difference(*pair, f"{place}[{number}]")
            if found is not None:
                return found
        return None
    # 1 and 1.0 are the same number, 1 and true are not.
    if here is there or (here == there and isinstance(here, bool) == isinstance(there, bool)):
        return None
    return place, _text(here), _text(there)


def _text(value: Any) -> str:
    if value is _NOTHING:
        return "nothing"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
