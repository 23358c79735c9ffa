"""Landmarks and other numbers that a caller gives, checked."""

from __future__ import annotations

import math
import operator
from typing import Any

from isomatch.errors import invalid

Pairs = list[tuple[int, int]]


def integer(field: str, value: Any, low: int, high: int) -> int:
    """InvalidInput: no integer from low to high."""
    try:
        number = operator.index(value)
    except TypeError:
        raise invalid(field, f"is {value!r}, expected an integer") from None
    if low <= number <= high:
        return number
    raise invalid(field, f"is {value!r}, expected an integer, {low} to {high}")


def milliseconds(field: str, seconds: Any, profile: str) -> int | None:
    """None for None. InvalidInput: not above 0, or not with this profile."""
    if seconds is None:
        return None
    try:
        found = math.ceil(1000 * seconds)
    except (TypeError, ValueError, OverflowError):
        found = 0
    if found <= 0:
        raise invalid(field, f"is {seconds!r}, expected seconds above 0, or None")
    if profile == "paper":
        raise invalid(field, f"is {seconds!r}, expected None with the profile 'paper'")
    return found


def landmark_pairs(landmarks: Any) -> Pairs:
    """InvalidInput: they are not k x 2 integers of 32 bits."""
    if hasattr(landmarks, "tolist"):
        landmarks = landmarks.tolist()
    pairs: Pairs = []
    try:
        rows = [list(row) for row in landmarks]
    except TypeError:
        raise invalid("landmarks", f"is {landmarks!r}, expected (k, 2) integers") from None
    for i, row in enumerate(rows):
        if len(row) != 2:
            raise invalid(f"landmarks[{i}]", f"is {row}, expected a vertex of X and one of Y")
        x, y = (
            integer(f"landmarks[{i}].{side}", value, 0, 2**32 - 1)
            for side, value in zip("xy", row)
        )
        pairs.append((x, y))
    return pairs


def check_vertices(pairs: Pairs, vertices_x: int, vertices_y: int) -> None:
    """InvalidInput when one names no vertex."""
    for i, (x, y) in enumerate(pairs):
        integer(f"landmarks[{i}].x", x, 0, vertices_x - 1)
        integer(f"landmarks[{i}].y", y, 0, vertices_y - 1)


def checked_landmarks(landmarks: Any, vertices_x: int, vertices_y: int) -> Pairs:
    """Both of the above; none for None."""
    if landmarks is None:
        return []
    pairs = landmark_pairs(landmarks)
    check_vertices(pairs, vertices_x, vertices_y)
    return pairs
