"""Writes meshes as Draco 2.2 streams: sequential, in single precision.

The layout is that of the Draco Bitstream Specification (header, metadata,
sequential connectivity, attributes) in its simplest form, without entropy
coding. Vertices and faces keep their order; a float32 keeps every bit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_TRIANGULAR_MESH = b"\x01"
_SEQUENTIAL = b"\x00"
_HAS_METADATA = 0x8000
_PLAIN_INDICES = b"\x01"
_PLAIN_VALUES = b"\x00"

# (attribute type, data type, components) of an attribute's declaration.
_POSITIONS = bytes([0, 9, 3])  # POSITION, FLOAT32
_VERTEX_IDS = bytes([4, 6, 1])  # GENERIC, UINT32

# A sequential stream holds at most this many points a face.
_MOST_POINTS_A_FACE = 3


@dataclass(frozen=True)
class EncodedMesh:
    """data: the stream. by_id: vertices are numbered by a vertex_id attribute,
    else by their order. vertices: of the mesh, those on no face too."""

    data: bytes
    by_id: bool
    vertices: int


def _varint(value: int) -> bytes:
    out = bytearray()
    while value >= 128:
        out.append(value & 127 | 128)
        value >>= 7
    return bytes(out + bytes([value]))


def _varints(values: NDArray[np.uint32]) -> bytes:
    """Of values below 2^21, so one to three bytes each."""
    septets = np.stack([values & 127, values >> 7 & 127, values >> 14], axis=-1)
    used = np.stack([values >= 0, values >= 1 << 7, values >= 1 << 14], axis=-1)
    septets[..., :2] |= used[..., 1:].astype(np.uint32) << 7  # another one follows
    data: bytes = septets[used].astype(np.uint8).tobytes()
    return data


def _indices(faces: NDArray[np.uint32], points: int) -> bytes:
    """As wide as the number of points asks for."""
    if points < 1 << 8:
        return faces.astype("u1").tobytes()
    if points < 1 << 16:
        return faces.astype("<u2").tobytes()
    if points < 1 << 21:
        return _varints(faces)
    return faces.astype("<u4").tobytes()


def _text(text: bytes) -> bytes:
    return bytes([len(text)]) + text


def _vertex_id_metadata() -> bytes:
    """That the attribute with unique id 1 has name=vertex_id."""
    entry = _text(b"name") + _text(b"vertex_id")
    of_attribute = _varint(1) + _varint(1) + entry + _varint(0)
    of_mesh = _varint(0) + _varint(0)
    return _varint(1) + of_attribute + of_mesh


def _stream(
    positions: NDArray[np.float32],
    faces: NDArray[np.uint32],
    ids: NDArray[np.uint32] | None,
) -> bytes:
    declarations = [_POSITIONS]
    values = [positions.astype("<f4").tobytes()]
    if ids is not None:
        declarations.append(_VERTEX_IDS)
        values.append(ids.astype("<u4").tobytes())
    flags = 0 if ids is None else _HAS_METADATA
    not_normalized = b"\x00"
    return b"".join(
        [
            b"DRACO\x02\x02" + _TRIANGULAR_MESH + _SEQUENTIAL,
            flags.to_bytes(2, "little"),
            b"" if ids is None else _vertex_id_metadata(),
            _varint(len(faces)) + _varint(len(positions)) + _PLAIN_INDICES,
            _indices(faces, len(positions)),
            _varint(1) + _varint(len(declarations)),
            *(d + not_normalized + _varint(i) for i, d in enumerate(declarations)),
            _PLAIN_VALUES * len(declarations),
            *values,
        ]
    )


def _near_origin(
    positions: NDArray[np.float64], faces: NDArray[np.uint32]
) -> NDArray[np.float32]:
    """The positions as they travel, as `isomatch match` sends them. Of a mesh far from
    the origin, as georeferenced ones are, single precision would leave little: it comes
    nearer by a multiple of the power of two from 8 to 16 times its extent."""
    on_faces = positions[faces.reshape(-1)]
    low, high = on_faces.min(axis=0), on_faces.max(axis=0)
    extent = float((high - low).max())
    origin = np.zeros(3)
    if extent > 0:
        step = math.ldexp(1, math.frexp(extent)[1] + 3)
        origin = np.floor(0.5 * (low + high) / step + 0.5) * step
    single: NDArray[np.float32] = (positions - origin).astype(np.float32)
    return single


def encode(positions: NDArray[np.float64], faces: NDArray[np.uint32]) -> EncodedMesh:
    """Returns the mesh as a Draco stream, in single precision, near the origin.

    positions: n x 3. faces: m x 3, m > 0, each below n. Where most vertices are
    on no face, only the others are written, with their numbers.
    """
    count = len(positions)
    single = _near_origin(positions, faces)
    if count <= _MOST_POINTS_A_FACE * len(faces):
        return EncodedMesh(_stream(single, faces, None), False, count)
    ids, renumbered = np.unique(faces, return_inverse=True)
    data = _stream(
        single[ids],
        renumbered.reshape(faces.shape).astype(np.uint32),
        ids.astype(np.uint32),
    )
    return EncodedMesh(data, True, count)
