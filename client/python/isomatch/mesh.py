"""Meshes as the functions of this package take them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isomatch import _mesh_file, _mesh_objects
from isomatch.errors import InvalidInput, InvalidType


class HasVerticesAndFaces(Protocol):
    """What trimesh and others call a mesh."""

    @property
    def vertices(self) -> Any: ...

    @property
    def faces(self) -> Any: ...


class HasVerticesAndTriangles(Protocol):
    """What Open3D calls a TriangleMesh."""

    @property
    def vertices(self) -> Any: ...

    @property
    def triangles(self) -> Any: ...


class HasPointsAndCells(Protocol):
    """What meshio calls a Mesh: `cells` are blocks with a type and data."""

    @property
    def points(self) -> Any: ...

    @property
    def cells(self) -> Any: ...


class HasPointsAndFaces(Protocol):
    """What PyVista calls PolyData: before the corners of each face their number."""

    @property
    def points(self) -> Any: ...

    @property
    def faces(self) -> Any: ...


@dataclass(frozen=True)
class UploadedMesh:
    """A mesh that Client.upload has brought to the server."""

    sha256: str
    size_bytes: int
    by_id: bool
    vertices: int


#: (vertices n x 3, faces m x 3), a path of a mesh file, a mesh of trimesh, Open3D,
#: meshio or PyVista, or what Client.upload returned.
MeshLike = Union[
    tuple[ArrayLike, ArrayLike],
    Sequence[ArrayLike],
    str,
    "os.PathLike[str]",
    HasVerticesAndFaces,
    HasVerticesAndTriangles,
    HasPointsAndCells,
    HasPointsAndFaces,
    UploadedMesh,
]


@dataclass(frozen=True)
class Mesh:
    """positions: n x 3, which single precision can hold. faces: m x 3, 0-based."""

    positions: NDArray[np.float64]
    faces: NDArray[np.uint32]


def invalid(field: str, message: str) -> InvalidInput:
    return InvalidInput(f"{field}: {message}", reason="INVALID_FIELD", field=field)


def _positions(values: ArrayLike, field: str) -> NDArray[np.float64]:
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise invalid(field, f"{error}, expected n x 3 numbers") from None
    if array.ndim != 2 or array.shape[1] != 3 or len(array) == 0:
        raise invalid(field, f"shape is {array.shape}, expected (n, 3)")
    with np.errstate(over="ignore"):
        single = array.astype(np.float32)
    wrong = np.flatnonzero(~np.isfinite(single).all(axis=1))
    if len(wrong) > 0:
        raise invalid(
            f"{field}[{wrong[0]}]",
            f"is {array[wrong[0]].tolist()}, expected numbers of single precision",
        )
    return np.ascontiguousarray(array)


def _faces(values: ArrayLike, vertices: int, field: str) -> NDArray[np.uint32]:
    array = np.asarray(values)
    if array.ndim != 2 or array.shape[1] != 3 or len(array) == 0:
        raise invalid(field, f"shape is {array.shape}, expected (m, 3)")
    if not np.issubdtype(array.dtype, np.integer):
        raise invalid(field, f"dtype is {array.dtype}, expected integers")
    wrong = np.flatnonzero(((array < 0) | (array >= vertices)).any(axis=1))
    if len(wrong) > 0:
        raise invalid(
            f"{field}[{wrong[0]}]",
            f"is {array[wrong[0]].tolist()}, expected vertices 0 to {vertices - 1}",
        )
    return np.ascontiguousarray(array, dtype=np.uint32)


def _arrays(value: MeshLike, field: str) -> Sequence[ArrayLike]:
    """Vertices and faces, not yet checked."""
    if isinstance(value, (str, os.PathLike)):
        return _mesh_file.read_mesh(value, field)
    if isinstance(value, Sequence) and len(value) == 2:
        return value
    try:
        arrays = _mesh_objects.arrays_of(value)
    except ValueError as error:
        raise invalid(field, f"is a {type(value).__name__}: {error}") from None
    if arrays is None:
        raise InvalidType(
            f"{field}: is a {type(value).__name__}, expected (vertices, faces), a path, "
            f"or {_mesh_objects.TAKEN}",
            reason="INVALID_FIELD",
            field=field,
        )
    return arrays


def as_mesh(value: MeshLike, field: str) -> Mesh:
    """Returns the mesh, checked; vertices keep their order.

    InvalidInput, whose field begins with `field`: another shape or dtype, a
    face that names no vertex, a coordinate that is no single-precision number,
    a file that cannot be read. InvalidType: nothing that is taken as a mesh.
    """
    arrays = _arrays(value, field)
    positions = _positions(arrays[0], f"{field}.vertices")
    return Mesh(positions, _faces(arrays[1], len(positions), f"{field}.faces"))


def read_mesh(path: str | os.PathLike[str]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Returns vertices (n x 3) and faces (m x 3) of an OFF, OBJ, PLY or STL file.

    Vertices keep the file's number and order; STL has none of its own: corners at
    one place become a vertex, in order of first use. Quadrilaterals are cut along their
    shorter diagonal, larger polygons into a fan, as `isomatch match` does.
    """
    return _mesh_file.read_mesh(path, "path")
