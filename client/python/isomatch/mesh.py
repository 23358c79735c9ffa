"""Meshes as the functions of this package take them."""

from __future__ import annotations

import ctypes
import os
import pathlib
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, Union

from isomatch import _library, _mesh_objects, _plain
from isomatch._arrays import address, copied
from isomatch._numpy import np
from isomatch.errors import InvalidInput, InvalidType, invalid

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
else:
    ArrayLike = Any


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


class HasVerticesAndPolygons(Protocol):
    """What Blender calls a Mesh; in the coordinates of its object."""

    @property
    def vertices(self) -> Any: ...

    @property
    def polygons(self) -> Any: ...

    @property
    def loops(self) -> Any: ...


@dataclass(frozen=True)
class UploadedMesh:
    """A mesh that Client.upload has brought to the server."""

    sha256: str
    size_bytes: int
    by_id: bool
    vertices: int


@dataclass(frozen=True)
class Mesh:
    """A mesh that was checked. positions: n x 3, which single precision can hold.
    faces: m x 3, 0-based. Without numpy one array of all numbers each. name: of its
    file, else empty."""

    positions: NDArray[np.float64]
    faces: NDArray[np.uint32]
    name: str = ""

    @property
    def num_vertices(self) -> int:
        return len(self.positions) // (3 if np is None else 1)

    @property
    def num_faces(self) -> int:
        return len(self.faces) // (3 if np is None else 1)

    def borrowed(self) -> _library.Mesh:
        """As the library takes it, while this is held."""
        return _library.Mesh(
            address(self.positions), self.num_vertices, address(self.faces), self.num_faces
        )


#: (vertices n x 3, faces m x 3), a path of a mesh file, a mesh of trimesh, Open3D,
#: meshio, PyVista or Blender, or what Client.upload returned.
MeshLike = Union[
    tuple[ArrayLike, ArrayLike],
    Sequence[ArrayLike],
    str,
    "os.PathLike[str]",
    HasVerticesAndFaces,
    HasVerticesAndTriangles,
    HasPointsAndCells,
    HasPointsAndFaces,
    HasVerticesAndPolygons,
    Mesh,
    UploadedMesh,
]


def _own(array: Any, dtype: Any) -> Any:
    """A copy that nobody changes: meshes outlive the call that got them."""
    copy = np.array(array, dtype=dtype, order="C")
    copy.flags.writeable = False
    return copy


def _positions(values: ArrayLike, field: str) -> NDArray[np.float64]:
    if np is None:
        return _plain.positions(values, field)
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
    return _own(array, np.float64)


def _faces(values: ArrayLike, vertices: int, field: str) -> NDArray[np.uint32]:
    if np is None:
        return _plain.faces(values, vertices, field)
    try:
        array = np.asarray(values)
    except (TypeError, ValueError) as error:
        raise invalid(field, f"{error}, expected m x 3 integers") from None
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
    return _own(array, np.uint32)


def _of_file(path: str | bytes | os.PathLike[Any], field: str) -> Mesh:
    """OSError: it cannot be opened."""
    name = os.fsdecode(os.fspath(path))
    with open(name, "rb"):
        pass
    file = _library.Owned("mesh_file")
    try:
        _library.call("mesh_file_read", os.fsencode(name), file.out)
    except InvalidInput as error:
        raise invalid(field, str(error).partition(": ")[2]) from None
    mesh = file.get("mesh").contents
    positions = ctypes.cast(mesh.positions, ctypes.POINTER(ctypes.c_double))
    faces = ctypes.cast(mesh.faces, ctypes.POINTER(ctypes.c_int32))
    name = pathlib.PurePath(name).name
    if np is None:
        flat = copied(positions, 3 * mesh.num_vertices), copied(faces, 3 * mesh.num_faces)
        return Mesh(array("d", flat[0]), array("i", flat[1]), name)  # type: ignore[arg-type]
    return Mesh(
        copied(positions, mesh.num_vertices, 3),
        copied(faces, mesh.num_faces, 3).view(np.uint32),
        name,
    )


def _arrays(value: MeshLike, field: str) -> Sequence[ArrayLike]:
    """Vertices and faces, not yet checked."""
    if isinstance(value, Sequence) and len(value) == 2:
        return value
    try:
        arrays = _mesh_objects.arrays_of(value)
    except ValueError as error:
        raise invalid(field, f"is a {type(value).__name__}: {error}") from None
    if arrays is None:
        kind = "an array alone" if hasattr(value, "dtype") else f"a {type(value).__name__}"
        raise InvalidType(
            f"{field}: is {kind}, expected (vertices, faces), a path, "
            f"or {_mesh_objects.TAKEN}",
            reason="INVALID_FIELD",
            field=field,
        )
    return arrays


def as_mesh(value: MeshLike, field: str) -> Mesh:
    """Returns the mesh, checked; vertices keep their order.

    InvalidInput, whose field begins with `field`: another shape or dtype, a
    face that names no vertex, a coordinate that is no single-precision number,
    a file that is no mesh. InvalidType: nothing that is taken as a mesh. OSError:
    a file that cannot be opened. LibraryNotFound: nothing here reads files.
    """
    if isinstance(value, Mesh):
        return value
    if isinstance(value, (str, bytes, os.PathLike)):
        return _of_file(value, field)
    arrays = _arrays(value, field)
    positions = _positions(arrays[0], f"{field}.vertices")
    rows = len(positions) // (3 if np is None else 1)
    return Mesh(positions, _faces(arrays[1], rows, f"{field}.faces"))


def read_mesh(path: str | os.PathLike[str]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Returns vertices (n x 3) and faces (m x 3) of a mesh file, of each format that
    `isomatch match` takes, as it reads it.

    Vertices keep the file's number and order; STL has none of its own: corners at
    one place become a vertex, in order of first use. Quadrilaterals are cut along their
    shorter diagonal, larger polygons into a fan. Errors: as as_mesh.
    """
    mesh = _of_file(path, "path")
    if np is None:
        return _plain.rows(mesh.positions), _plain.rows(mesh.faces)
    return mesh.positions, mesh.faces.astype(np.int64)
