"""Which sources a library was compiled from: a number that goes into it, asked for when it is loaded."""

from __future__ import annotations

import hashlib
from pathlib import Path


def digest(folder: Path) -> int | None:
    """Return 64 bits of a digest of the C sources in a folder, None where there are none, as in a wheel."""
    sources = sorted(folder.glob("*.[ch]"))
    seen = hashlib.sha256()
    for source in sources:
        seen.update(source.name.encode() + b"\0" + source.read_bytes())
    return int.from_bytes(seen.digest()[:8], "big") if sources else None
