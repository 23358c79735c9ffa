"""The result of a match as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isomatch.errors import DataLoss
from isomatch.mesh import invalid
from isomatch.status import ResultInfo, Verdict

_POINT = np.dtype([("vertices", "<u4", (3,)), ("weights", "<f4", (3,))])


@dataclass(frozen=True)
class PreciseMap:
    """For each vertex of X a point on a face of Y.

    vertices: n x 3, of that face, -1 for no place. weights: n x 3, sum 1.
    """

    vertices: NDArray[np.int32]
    weights: NDArray[np.float32]


@dataclass(frozen=True)
class FunctionalMap:
    """The first k eigenfunctions of Y carried to X.

    eigenvalues: k each, 1 / area. fmap_x_from_y: k x k; columns are
    eigenfunctions of Y, rows of X.
    """

    eigenvalues_x: NDArray[np.float64]
    eigenvalues_y: NDArray[np.float64]
    fmap_x_from_y: NDArray[np.float64]


@dataclass(frozen=True)
class MatchResult:
    """What a match found, in the vertex numbers of the meshes given.

    y_from_x: n integers, the vertex of Y for each vertex of X; -1 for a vertex
      on no face (see `matched` before you index with it).
    vertices_y: the number of vertices of Y.
    info: quality, scores, times, warnings, what became of the landmarks.
    job: the job's name on the server.
    confidence: n, 0 (do not trust) to 1; alternative: as y_from_x, the best map
      that was not chosen, a symmetric image as a rule. These, `precise` and
      `functional_map` are None when not asked for or not there.
    """

    y_from_x: NDArray[np.int32]
    vertices_y: int
    info: ResultInfo
    job: str
    confidence: NDArray[np.float32] | None = None
    precise: PreciseMap | None = None
    alternative: NDArray[np.int32] | None = None
    functional_map: FunctionalMap | None = None

    @property
    def verdict(self) -> Verdict:
        """Whether the map is good, doubtful or bad, why, and what to do."""
        return self.info.verdict

    @property
    def matched(self) -> NDArray[np.bool_]:
        """n, where y_from_x names a vertex."""
        return self.y_from_x >= 0

    def transfer(
        self, values_y: ArrayLike, *, interpolate: bool = False, missing: Any = 0
    ) -> NDArray[Any]:
        """Returns the values of Y's vertices carried to X's.

        values_y: one row (or number) a vertex of Y: colors, texture
        coordinates, labels. interpolate: between the vertices of the face that
        `precise` names (ask for it), for smooth values; not for labels, nor for
        texture coordinates that have seams. missing: where there is no match.
        """
        values = np.asarray(values_y)
        if values.ndim == 0 or len(values) != self.vertices_y:
            raise invalid(
                "values_y",
                f"shape is {values.shape}, expected {self.vertices_y} rows, one a vertex",
            )
        if not interpolate:
            carried = values[self.y_from_x]
        elif self.precise is None:
            raise invalid("interpolate", "there is no precise map, expected precise=True")
        else:
            carried = np.einsum(
                "nk,nk...->n...", self.precise.weights, values[self.precise.vertices]
            )
        carried[~self.matched] = missing
        return carried


def _lost(what: str, found: object, expected: object) -> DataLoss:
    return DataLoss(f"{what}: {found}, expected {expected}")


def _check_bytes(what: str, data: bytes, expected: int) -> None:
    if len(data) != expected:
        raise _lost(what, f"{len(data)} bytes", f"{expected} bytes")


def _indices(what: str, stored: NDArray[np.uint32], end: int) -> NDArray[np.int32]:
    """0xFFFFFFFF as -1; the others are below `end`."""
    indices = stored.astype(np.int64)
    indices[indices == 0xFFFFFFFF] = -1
    if len(indices) > 0 and indices.max() >= end:
        raise _lost(what, f"vertex {indices.max()}", f"less than {end}")
    return indices.astype(np.int32)


# Each decodes the bytes of a part, whose layout ResultPart in service.proto
# gives; n and end are the numbers of vertices of X and of Y. DataLoss: another
# number of bytes, or a vertex that Y does not have.


def decode_map(data: bytes, n: int, end: int) -> NDArray[np.int32]:
    _check_bytes("map", data, 4 * n)
    return _indices("map", np.frombuffer(data, "<u4"), end)


def decode_precise(data: bytes, n: int, end: int) -> PreciseMap:
    _check_bytes("precise map", data, _POINT.itemsize * n)
    points = np.frombuffer(data, _POINT)
    vertices = _indices("precise map", points["vertices"], end)
    return PreciseMap(vertices, points["weights"].astype(np.float32))


def decode_confidence(data: bytes, n: int, end: int) -> NDArray[np.float32]:
    del end
    _check_bytes("confidence", data, 4 * n)
    return np.frombuffer(data, "<f4").astype(np.float32)


def decode_functional_map(data: bytes, n: int, end: int) -> FunctionalMap:
    del n, end
    k = int.from_bytes(data[:4], "little")
    _check_bytes("functional map", data, 4 + 8 * (2 * k + k * k))
    numbers = np.frombuffer(data, "<f8", offset=4).astype(np.float64)
    return FunctionalMap(numbers[:k], numbers[k : 2 * k], numbers[2 * k :].reshape(k, k))
