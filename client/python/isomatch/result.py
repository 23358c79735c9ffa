"""The result of a match as arrays."""

from __future__ import annotations

import dataclasses
import math
import os
import pathlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from isomatch import _page
from isomatch._numpy import np
from isomatch._landmarks import integer
from isomatch.errors import FailedPrecondition, invalid
from isomatch.mesh import Mesh, MeshLike, as_mesh
from isomatch.status import ResultInfo, Verdict

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, eq=False)
class PreciseMap:
    """For each vertex of X a point on a face of Y.

    vertices: n x 3, of that face, -1 for no place. weights: n x 3, sum 1.
    """

    vertices: NDArray[np.int32]
    weights: NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class FunctionalMap:
    """The first k eigenfunctions of Y carried to X.

    eigenvalues: k each, 1 / area. fmap_x_from_y: k x k; columns are
    eigenfunctions of Y, rows of X.
    """

    eigenvalues_x: NDArray[np.float64]
    eigenvalues_y: NDArray[np.float64]
    fmap_x_from_y: NDArray[np.float64]

    def first(self, k: int) -> FunctionalMap:
        """That of the first k eigenfunctions alone."""
        return FunctionalMap(
            self.eigenvalues_x[:k],
            self.eigenvalues_y[:k],
            _each(self.fmap_x_from_y[:k], lambda row: row[:k]),
        )


def _each(rows: Any, function: Any) -> Any:
    """The function of each row, in an array as `rows` is one."""
    found = [function(row) for row in rows]
    return found if np is None else np.array(found)


@dataclass(frozen=True, eq=False, repr=False)
class MatchResult:
    """What a match found, in the vertex numbers of the meshes given. Arrays are those
    of numpy, or lists where numpy is not installed.

    y_from_x: n integers, the vertex of Y for each vertex of X; -1 for one without
      a counterpart: on no face or, with the relations "part-of-x" and "overlap", on
      what y lacks (see `matched` before you index with it).
    vertices_y: the number of vertices of Y.
    info: quality, scores, times, warnings, what became of the landmarks.
    job: the job's name on the server; empty for a match in this process.
    confidence: n, 0 (do not trust) to 1; alternative: as y_from_x, the best map
      that was not chosen, a symmetric image as a rule. These and `precise` are None
      when not asked for or not there.
    spectral: what functional_map() gives.
    matched_y: whether x has a counterpart, for each vertex of Y; None as above.
      Between whole shapes each on a face has one.
    meshes: X and Y, where they are known, for `view`.
    """

    y_from_x: NDArray[np.int32]
    vertices_y: int
    info: ResultInfo
    job: str = ""
    confidence: NDArray[np.float32] | None = None
    precise: PreciseMap | None = None
    alternative: NDArray[np.int32] | None = None
    spectral: FunctionalMap | None = None
    matched_y: NDArray[np.bool_] | None = None
    meshes: tuple[Mesh | None, Mesh | None] = (None, None)

    def __repr__(self) -> str:
        sizes = f"{len(self.y_from_x)} vertices of X on {self.vertices_y} of Y"
        return f"<isomatch.MatchResult {sizes}: {self.verdict}>"

    @property
    def verdict(self) -> Verdict:
        """Whether the map is good, doubtful or bad, why, and what to do."""
        return self.info.verdict

    @property
    def matched(self) -> NDArray[np.bool_]:
        """n, where y_from_x names a vertex."""
        if np is None:
            return [y >= 0 for y in self.y_from_x]  # type: ignore[return-value]
        return self.y_from_x >= 0

    def functional_map(self, k: int | None = None) -> FunctionalMap:
        """The map as one of functions, of the first k eigenfunctions, by default of all
        that were computed. FailedPrecondition: it was not asked for by
        functional_map=True."""
        if self.spectral is None:
            raise FailedPrecondition(
                "there is no functional map, expected functional_map=True when matching"
            )
        most = len(self.spectral.eigenvalues_x)
        if k is None:
            return self.spectral
        return self.spectral.first(integer("k", k, 1, most))

    def transfer(
        self, values_y: ArrayLike, *, interpolate: bool | None = None, missing: Any = None
    ) -> NDArray[Any]:
        """Returns the values of Y's vertices carried to X's.

        values_y: one row (or number) a vertex of Y: scalars, vectors, colors, labels,
        skin weights. interpolate: between the vertices of the face that `precise` names,
        for smooth values; by default where that is there and they are floating-point
        numbers, and never for integers and labels. Weights that sum to 1 do so on X.
        missing: what vertices without a match get, by default -1 for integers, NaN for
        floating-point numbers, and what is empty or false of other types. Texture
        coordinates with seams: see transfer_texture.
        """
        if np is None:
            return self._transfer_lists(values_y, interpolate, missing)
        try:
            values = np.asarray(values_y)
        except (TypeError, ValueError) as error:
            raise invalid("values_y", f"{error}, expected one row a vertex") from None
        if values.ndim == 0 or len(values) != self.vertices_y:
            raise invalid(
                "values_y",
                f"shape is {values.shape}, expected {self.vertices_y} rows, one a vertex",
            )
        if interpolate is None:
            interpolate = self.precise is not None and values.dtype.kind in "fc"
        if not interpolate:
            carried = values[self.y_from_x]
        elif self.precise is None:
            raise invalid("interpolate", "there is no precise map, expected precise=True")
        else:
            carried = np.einsum(
                "nk,nk...->n...", self.precise.weights, values[self.precise.vertices]
            )
        if self.matched.all():
            return carried
        if missing is None:
            missing = {"i": -1, "u": -1, "f": np.nan, "c": np.nan}.get(
                carried.dtype.kind, np.zeros((), carried.dtype)[()]
            )
        carried = carried.astype(np.result_type(carried.dtype, np.min_scalar_type(missing)))
        carried[~self.matched] = missing
        return carried

    def _transfer_lists(self, values: Any, interpolate: bool | None, missing: Any) -> Any:
        """Rows are numbers, or lists of them, or anything that is not interpolated."""
        if len(values) != self.vertices_y:
            raise invalid("values_y", f"{len(values)} rows, expected {self.vertices_y}")
        real = any(map(_is_real, values))
        if missing is None:
            missing = math.nan if real else -1 if isinstance(values[0], (int, list, tuple)) else ""
        if interpolate is None:
            interpolate = self.precise is not None and real
        if interpolate and self.precise is None:
            raise invalid("interpolate", "there is no precise map, expected precise=True")
        missing = _in_shape_of(values[0], missing)
        if not interpolate:
            return [missing if y < 0 else values[y] for y in self.y_from_x]
        assert self.precise is not None
        return [
            missing if corners[0] < 0 else _mean([values[v] for v in corners], weights)
            for corners, weights in zip(self.precise.vertices, self.precise.weights)
        ]

    def transfer_texture(
        self, uv_y: ArrayLike, *, x: MeshLike | None = None, y: MeshLike | None = None
    ) -> NDArray[np.float64]:
        """Returns the texture coordinates of Y's corners carried to X's: faces of X x 3
        x 2, NaN where there are none. No face of X gets them from two sides of a seam.

        uv_y: faces of Y x 3 x 2, NaN for none. x, y: the meshes, where the result does
        not know them.
        """
        return _page.carry_texture(self, *self._both_meshes(x, y), uv_y)

    def page(
        self, title: str | None = None, *, x: MeshLike | None = None, y: MeshLike | None = None
    ) -> str:
        """Returns an HTML document that shows the map: both shapes in 3D. It asks
        nothing of the network. x, y: as of transfer_texture."""
        return _page.make(self, *self._both_meshes(x, y), title)

    def view(
        self,
        path: str | os.PathLike[str] | None = None,
        *,
        title: str | None = None,
        x: MeshLike | None = None,
        y: MeshLike | None = None,
    ) -> pathlib.Path | None:
        """Shows the map: inside a notebook below its cell, else in the browser, from a
        file among the temporary ones whose path is returned. With `path` the page is
        written there, and not opened."""
        return _page.show(self.page(title, x=x, y=y), path)

    def _repr_html_(self) -> str | None:
        """The page, for notebooks; None, so that they show the text, where the meshes
        are not known."""
        if None in self.meshes:
            return None
        return _page.frame(self.page())

    def _both_meshes(self, x: MeshLike | None, y: MeshLike | None) -> tuple[Mesh, Mesh]:
        mesh_x = _known("x", x, self.meshes[0], len(self.y_from_x))
        return mesh_x, _known("y", y, self.meshes[1], self.vertices_y)

    def report(self) -> dict[str, Any]:
        """What `isomatch match --report` writes, but the memory that a server reserved."""
        info = self.info
        seconds = dict(info.stage_seconds)
        found: dict[str, Any] = {
            "mesh_x": _summary(info.mesh_x),
            "mesh_y": _summary(info.mesh_y),
            "verdict": dataclasses.asdict(info.verdict),
            "landmarks": [dataclasses.asdict(landmark) for landmark in info.landmarks],
            "profile": info.profile,
            "relation": info.relation,
            "relation_confidence": info.relation_confidence,
            "scale": info.scale,
            "random_seed": info.random_seed,
            "ended_early": info.ended_early,
            "seconds": seconds,
            "total_seconds": info.run_seconds,
            "peak_resident_bytes": info.peak_resident_bytes,
            "unmatched": info.unmatched,
            "embedding_error": info.scores.embedding_error,
            "objective": info.objective,
            "orientation_score": info.scores.orientation_score,
            "scores": dataclasses.asdict(info.scores),
            "quality": dataclasses.asdict(info.quality),
            "symmetry_confidence": info.symmetry_confidence,
            "alternatives": [{"scores": dataclasses.asdict(s)} for s in info.alternatives],
            "warnings": [
                *(f"X: {text}" for text in info.mesh_x.warnings),
                *(f"Y: {text}" for text in info.mesh_y.warnings),
                *info.warnings,
            ],
        }
        return _without_nan(found)


def _is_real(value: Any) -> bool:
    """Whether a number has a point, or one of a list of numbers."""
    if isinstance(value, (list, tuple)):
        return any(map(_is_real, value))
    return isinstance(value, float)


def _in_shape_of(row: Any, value: Any) -> Any:
    """The value, or a list of as many as the row has."""
    return [_in_shape_of(entry, value) for entry in row] if isinstance(row, (list, tuple)) else value


def _mean(rows: list[Any], weights: Any) -> Any:
    """Of three numbers, or lists of numbers."""
    if isinstance(rows[0], (list, tuple)):
        return [_mean(list(column), weights) for column in zip(*rows)]
    return sum(weight * number for weight, number in zip(weights, rows))


def _known(field: str, given: MeshLike | None, known: Mesh | None, vertices: int) -> Mesh:
    """The mesh that is given, else the one that is known; with so many vertices."""
    mesh = known if given is None else as_mesh(given, field)
    if mesh is None:
        raise invalid(field, "is None, expected the mesh, which is not known here")
    if mesh.num_vertices != vertices:
        raise invalid(field, f"has {mesh.num_vertices} vertices, expected {vertices}")
    return mesh


def _summary(mesh: Any) -> dict[str, Any]:
    return {"vertices": mesh.vertices, "faces": mesh.faces, "area": mesh.area}


def _without_nan(value: Any) -> Any:
    """What JSON has no number for is null."""
    if isinstance(value, dict):
        return {key: _without_nan(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_without_nan(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
