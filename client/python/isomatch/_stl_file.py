"""Reads STL files, which have corners only: those at one place become a vertex."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from isomatch._lines import Lines, place, read_lines

_HEADER_BYTES = 84
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def _join(corners: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The places among 3m corners, in order of first use, and m x 3 faces."""
    order = np.lexsort(corners.T)  # a stable sort
    in_order = corners[order]
    is_first = np.ones(len(corners), dtype=bool)
    is_first[1:] = (in_order[1:] != in_order[:-1]).any(axis=1)
    first_uses = order[is_first]
    by_use = np.argsort(first_uses)
    number = np.empty_like(by_use)
    number[by_use] = np.arange(len(by_use))
    vertex = np.empty(len(corners), dtype=np.int64)
    vertex[order] = number[np.cumsum(is_first) - 1]
    return corners[first_uses[by_use]], vertex.reshape(-1, 3)


def _ascii_corners(lines: Lines) -> list[list[float]]:
    corners: list[list[float]] = []
    facets = 0
    ended = False
    while (words := lines.row()) is not None:
        if words[:1] == ["vertex"]:
            corners.append(place(words[1:]))
        elif words[:1] == ["endfacet"]:
            facets += 1
            if len(corners) != 3 * facets:
                raise ValueError(f"facet {facets - 1} has not three corners")
        elif words[:1] == ["endsolid"]:
            ended = True
    if not ended or len(corners) != 3 * facets:
        raise ValueError("it ends within a solid, expected `endsolid`")
    return corners


def read_stl(data: bytes) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Returns vertices, in order of their first use, and faces.

    Corners are one vertex when their coordinates are equal, as `isomatch match`
    joins them. ValueError: a damaged file.
    """
    facets = int.from_bytes(data[_HEADER_BYTES - 4 : _HEADER_BYTES], "little")
    size = _HEADER_BYTES + _FACET.itemsize * facets
    # What is text has a number of facets there that no file is long enough for.
    if len(data) >= max(size, _HEADER_BYTES):
        table = np.frombuffer(data, _FACET, facets, _HEADER_BYTES)
        return _join(table["corners"].reshape(-1, 3).astype(np.float64))
    if b"\0" in data or not data.lstrip().startswith(b"solid"):
        raise ValueError(f"{len(data)} bytes, expected {size} for {facets} facets")
    corners = read_lines(Lines(data), _ascii_corners)
    return _join(np.array(corners, dtype=np.float64).reshape(-1, 3))
