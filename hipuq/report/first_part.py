"""The first part of a report, in its order: a block for each question that an engineer has to answer."""

from __future__ import annotations

from collections.abc import Callable

from hipuq.report.agreement import agreement
from hipuq.report.bench import bench
from hipuq.report.block import Block
from hipuq.report.drivers import drivers
from hipuq.report.friction import fragility_block, limit_block
from hipuq.report.grounds import inputs, limits, repeat
from hipuq.report.over_damping import over_damping
from hipuq.report.parts import by_count, by_mode
from hipuq.report.reading import Reading
from hipuq.report.squeak import headline
from hipuq.report.verdicts import verdicts

ORDER: tuple[Callable[[Reading], Block], ...] = (
    headline,
    over_damping,
    by_count,
    by_mode,
    fragility_block,
    limit_block,
    drivers,
    agreement,
    bench,
    verdicts,
    inputs,
    limits,
    repeat,
)
"""What makes the blocks, in their order."""


def blocks(reading: Reading) -> list[Block]:
    """Return the blocks that have anything to say.

    Parameters
    ----------
    reading : Reading

    Returns
    -------
    list of Block
        None where the results hold no analysis.
    """
    if not any("of" in one.attrs for groups in reading.found.values() for one in groups.values()):
        return []
    made = [make(reading) for make in ORDER]
    return [one for one in made if one.lines or one.tables or one.text or one.items]
