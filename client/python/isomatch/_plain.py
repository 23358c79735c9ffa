"""Meshes of lists, where numpy is not installed; errors are those of isomatch.mesh."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Sequence
from typing import Any

from isomatch.errors import invalid

# What rounds to no finite number of single precision.
_TOO_LARGE = 2.0**128 - 2.0**103


def _triples(values: Any, field: str) -> Iterable[Sequence[Any]]:
    """Each row, which has three entries."""
    try:
        found = [list(row) for row in values]
    except TypeError:
        raise invalid(field, f"is a {type(values).__name__}, expected rows of 3") from None
    if not found:
        raise invalid(field, "there are none, expected rows of 3")
    for number, row in enumerate(found):
        if len(row) != 3:
            raise invalid(f"{field}[{number}]", f"is {row}, expected 3 numbers")
    return found


def positions(values: Any, field: str) -> Any:
    """Rows of three coordinates as one array."""
    flat = array("d")
    for number, row in enumerate(_triples(values, field)):
        try:
            place = [float(value) for value in row]
        except (TypeError, ValueError):
            place = [math.nan]
        if not all(math.isfinite(value) and abs(value) < _TOO_LARGE for value in place):
            raise invalid(
                f"{field}[{number}]", f"is {row}, expected numbers of single precision"
            )
        flat.extend(place)
    return flat


def faces(values: Any, vertices: int, field: str) -> Any:
    """Rows of three vertices as one array."""
    flat = array("i")
    for number, row in enumerate(_triples(values, field)):
        if not all(isinstance(v, int) and 0 <= v < vertices for v in row):
            raise invalid(
                f"{field}[{number}]", f"is {row}, expected vertices 0 to {vertices - 1}"
            )
        flat.extend(row)
    return flat


def rows(flat: Any) -> Any:
    """Its numbers by threes."""
    return [list(flat[i : i + 3]) for i in range(0, len(flat), 3)]
