"""Meshes of other packages, told by their attributes: none of them is imported."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from isomatch._numpy import np
from isomatch._triangulation import triangulate

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
else:
    ArrayLike = Any

# The cells of meshio that are faces of a surface.
_SURFACE_CELLS = {"triangle", "quad", "polygon"}


_Arrays = tuple[ArrayLike, ArrayLike]


def _counted_polygons(faces: list[int]) -> Iterator[list[int]]:
    at = 0
    while at < len(faces):
        end = at + 1 + faces[at]
        if end <= at or end > len(faces):
            raise ValueError(f"faces[{at}] is {faces[at]}, expected a number of corners")
        yield faces[at + 1 : end]
        at = end


def _of_trimesh(mesh: Any) -> _Arrays:
    return mesh.vertices, mesh.faces


def _of_open3d(mesh: Any) -> _Arrays:
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles)


def _of_pyvista(mesh: Any) -> _Arrays:
    """`faces` is flat: a number of corners, then the corners, for each face."""
    faces = np.asarray(mesh.faces).reshape(-1)
    if len(faces) % 4 == 0 and (faces[::4] == 3).all():
        return mesh.points, faces.reshape(-1, 4)[:, 1:]
    polygons = _counted_polygons(faces.tolist())
    return mesh.points, triangulate(polygons, np.asarray(mesh.points))


def _of_meshio(mesh: Any) -> _Arrays:
    if isinstance(mesh.cells, np.ndarray):  # PyVista's grids
        raise ValueError("it has cells, expected a surface: its .extract_surface()")
    kinds = [block.type for block in mesh.cells]
    blocks = [block.data for block in mesh.cells if block.type in _SURFACE_CELLS]
    if not blocks:
        raise ValueError(
            f"its cells are {', '.join(sorted(set(kinds))) or 'none'}, expected "
            f"{', '.join(sorted(_SURFACE_CELLS))}"
        )
    points = np.asarray(mesh.points)
    if _SURFACE_CELLS.intersection(kinds) == {"triangle"}:
        return points, np.vstack(blocks)
    polygons = (polygon for block in blocks for polygon in np.asarray(block).tolist())
    return points, triangulate(polygons, points)


def _of_blender(mesh: Any) -> _Arrays:
    """A bpy.types.Mesh, whose collections fill arrays by foreach_get."""

    def column(collection: Any, name: str, dtype: type, width: int = 1) -> Any:
        values = np.empty(width * len(collection), dtype=dtype)
        collection.foreach_get(name, values)
        return values

    points = column(mesh.vertices, "co", np.float32, 3).reshape(-1, 3)
    corners = column(mesh.loops, "vertex_index", np.int32).tolist()
    starts = column(mesh.polygons, "loop_start", np.int32).tolist()
    totals = column(mesh.polygons, "loop_total", np.int32).tolist()
    polygons = (corners[start : start + total] for start, total in zip(starts, totals))
    return points, triangulate(polygons, points.astype(np.float64))


#: What is taken beside (vertices, faces) and paths, for messages.
TAKEN = (
    "an object with .vertices and .faces (trimesh), .vertices and .triangles (Open3D), "
    ".points and .cells (meshio), .points and .faces (PyVista) or .vertices and .polygons "
    "(Blender)"
)


# Two attributes that a mesh has, and how it is read then; the first that fits.
_READERS: list[tuple[str, str, Callable[[Any], _Arrays]]] = [
    ("vertices", "faces", _of_trimesh),
    ("vertices", "triangles", _of_open3d),
    ("points", "cells", _of_meshio),
    ("points", "faces", _of_pyvista),
    ("vertices", "polygons", _of_blender),
]


def arrays_of(mesh: Any) -> _Arrays | None:
    """Returns vertices and faces; None for what is none of TAKEN.

    Polygons are cut as those of files are. ValueError: it has no faces, or they
    are damaged.
    """
    if getattr(mesh, "type", None) == "MESH" and hasattr(mesh, "data"):
        mesh = mesh.data  # an object of Blender
    for vertices, faces, read in _READERS:
        if hasattr(mesh, vertices) and hasattr(mesh, faces):
            return read(mesh)
    return None
