"""Polygons as triangles, as `isomatch match` cuts them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from isomatch._numpy import np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def _fan_start(polygon: Sequence[int], vertices: NDArray[np.float64]) -> int:
    """The corner to cut from: of the shorter diagonal of a quadrilateral."""
    if len(polygon) != 4 or max(polygon) >= len(vertices) or min(polygon) < 0:
        return 0
    a, b, c, d = (vertices[corner] for corner in polygon)
    return 1 if np.sum((b - d) ** 2) < np.sum((a - c) ** 2) else 0


def triangulate(
    polygons: Iterable[Sequence[int]], vertices: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Returns m x 3: quadrilaterals along their shorter diagonal, larger polygons
    as a fan. ValueError: one has fewer than three corners."""
    triangles: list[tuple[int, int, int]] = []
    for number, polygon in enumerate(polygons):
        if len(polygon) == 3:
            triangles.append((polygon[0], polygon[1], polygon[2]))
            continue
        if len(polygon) < 3:
            raise ValueError(
                f"face {number} has {len(polygon)} corners, expected 3 or more"
            )
        start = _fan_start(polygon, vertices)
        fan = [*polygon[start:], *polygon[:start]]
        triangles += [(fan[0], fan[i], fan[i + 1]) for i in range(1, len(fan) - 1)]
    return np.array(triangles, dtype=np.int64).reshape(-1, 3)
