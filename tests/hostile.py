"""What the tests of hostile files share: evil values, mutations of tables, and a TOML writer for them."""

import copy
import datetime
import json
import math

from hipuq.distributions import DISTRIBUTIONS, FAMILIES
from hipuq.methods import METHODS
from hipuq.methods.base import STAGES
from hipuq.models import MODELS, PRESETS

NUMBERS = [
    *(math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, 1e300, 1e-300, -0.0, 0.5, 1e15),
    *(0, 1, -1, 2, 3, 64, 10**9, 2**62, 2**63 - 1, -(2**63), 10**30, 2**53 + 1, True, False),
]
STRINGS = [
    *(
        "",
        " ",
        "x" * 100_000,
        "../../x",
        "/etc/passwd",
        "/dev/zero",
        "con",
        "a/b",
        "a\nb",
        "\x00",
        "\x1b[31m",
    ),
    *(
        "\u202e",
        "a\u2028b",
        "\uff46riction",
        "\u00df" * 300,
        "\U0001f600",
        "nan",
        "%s%n",
        "__class__",
        "self",
    ),
]
OTHERS = [
    *(datetime.datetime(2020, 1, 1), datetime.time(1, 2), [], {}, [[]], [{}], [math.nan], [""], [True]),
    *(list(range(10_000)), [1, "a", {}], {"": 1}, {"a": {"b": [1]}}, [[1, 2], [3]], [1e308] * 9),
]
WORDS = sorted(
    {
        *(*METHODS, *MODELS, *DISTRIBUTIONS, *(one for own in PRESETS.values() for one in own)),
        *(name for method in METHODS.values() for stage in STAGES for name in method.options(stage)),
        *(name for _, must, may in FAMILIES.values() for name in must + may),
        *("friction", "k3", "contact", "mass", "damping_ratio", "any_unstable", "margin", "probability"),
        *("random", "sobol", "relative", "shift", "each", "spring", "weights", "components", "film", "value"),
        *("model", "inputs", "analysis", "options", "over", "compare", "contenders", "problem", "reference"),
    }
)


def evil(r, depth=0):
    """Return a value that a file should not have, or not there."""
    kind = r.random()
    if kind < 0.4:
        return r.choice(NUMBERS)
    if kind < 0.55:
        return r.choice(STRINGS)
    if kind < 0.75:
        return r.choice(WORDS)
    if kind < 0.8:
        return nested(r.choice([5, 19, 99, 300]), r.random() < 0.5)
    if kind < 0.95 or depth > 3:
        return copy.deepcopy(r.choice(OTHERS))
    return [evil(r, depth + 1) for _ in range(r.randint(0, 4))]


def nested(depth, listed):
    value = 0
    for _ in range(depth):
        value = [value] if listed else {"a": value}
    return value


def mutate(table, r):
    """Change something somewhere in nested tables and lists."""
    places = list(_places(table))
    holder, key = r.choice(places)
    name = r.choice(WORDS if r.random() < 0.7 else STRINGS)
    kind = r.random()
    if isinstance(holder, list):
        holder[key] = evil(r) if kind < 0.7 else copy.deepcopy(r.choice(holder))
    elif kind < 0.5:
        holder[key] = evil(r)
    elif kind < 0.7:
        holder[name] = evil(r)
    elif kind < 0.8:
        holder[name] = holder.pop(key)
    elif kind < 0.9:
        del holder[key]
    else:
        other, there = r.choice(places)
        holder[key] = copy.deepcopy(other[there])


def _places(value):
    for key in list(value) if isinstance(value, dict) else range(len(value)):
        yield value, key
        if isinstance(value[key], (dict, list)) and len(value[key]) < 50:
            yield from _places(value[key])


def toml(value):
    """Return a value as inline TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, (datetime.date, datetime.time)):
        return value.isoformat()
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml(key)} = {toml(own)}" for key, own in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def garbled(data, r):
    """Return bytes that were cut, overwritten, or grew."""
    data = bytearray(data)
    for _ in range(r.randint(1, 3)):
        at = r.randint(0, len(data))
        part = bytes(r.randint(0, 255) for _ in range(r.randint(1, 12)))
        kind = r.randint(0, 3)
        if kind == 0:
            data = data[:at]
        elif kind == 1:
            data[at : at + len(part)] = part
        elif kind == 2:
            data[at:at] = part
        else:
            data[at:at] = data[: r.randint(0, 200)]
    return bytes(data)
