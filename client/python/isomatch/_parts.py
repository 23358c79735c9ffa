"""The parts of a result as they arrive from a server, as arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from isomatch.errors import DataLoss
from isomatch.result import FunctionalMap, PreciseMap

_POINT = np.dtype([("vertices", "<u4", (3,)), ("weights", "<f4", (3,))])


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
# number of bytes, a vertex that Y does not have, or a flag that is none.


def decode_map(data: bytes, n: int, end: int) -> NDArray[np.int32]:
    _check_bytes("map", data, 4 * n)
    return _indices("map", np.frombuffer(data, "<u4"), end)


def decode_precise(data: bytes, n: int, end: int) -> PreciseMap:
    _check_bytes("precise map", data, _POINT.itemsize * n)
    points = np.frombuffer(data, _POINT)
    vertices = _indices("precise map", points["vertices"], end)
    return PreciseMap(vertices, points["weights"].astype(np.float64))


def decode_confidence(data: bytes, n: int, end: int) -> NDArray[np.float32]:
    del end
    _check_bytes("confidence", data, 4 * n)
    return np.frombuffer(data, "<f4").astype(np.float32)


def decode_mask_y(data: bytes, n: int, end: int) -> NDArray[np.bool_]:
    del n
    _check_bytes("mask of Y", data, end)
    flags = np.frombuffer(data, np.uint8)
    if end > 0 and flags.max() > 1:
        raise _lost("mask of Y", f"a byte {flags.max()}", "0 or 1")
    return flags.astype(np.bool_)


def decode_functional_map(data: bytes, n: int, end: int) -> FunctionalMap:
    del n, end
    k = int.from_bytes(data[:4], "little")
    _check_bytes("functional map", data, 4 + 8 * (2 * k + k * k))
    numbers = np.frombuffer(data, "<f8", offset=4).astype(np.float64)
    return FunctionalMap(numbers[:k], numbers[k : 2 * k], numbers[2 * k :].reshape(k, k))
