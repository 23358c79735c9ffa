"""Meshes of other packages: of meshio itself, of the others by what they look like."""

import unittest

import meshio
import numpy as np

import isomatch
from isomatch import _draco
from isomatch.mesh import as_mesh

POINTS = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0.5], [0, 2, 0], [1, 3.25, 0]])
# Of the square and the roof; the square's shorter diagonal is 1-3.
TRIANGLES = [[1, 2, 3], [1, 3, 0], [2, 4, 3]]


class Mesh:
    """With the attributes that it is given."""

    def __init__(self, **attributes):
        vars(self).update(attributes)


class Vector:
    """As Open3D's: no array, but to be had as one."""

    def __init__(self, values):
        self._values = values

    def __array__(self, dtype=None, copy=None):
        return np.array(self._values, dtype=dtype)


class Collection:
    """As Blender's: its columns are copied into arrays that the caller brings."""

    def __init__(self, **columns):
        self._columns = {name: np.asarray(values) for name, values in columns.items()}

    def __len__(self):
        return len(next(iter(self._columns.values())))

    def foreach_get(self, name, flat):
        flat[:] = self._columns[name].ravel()


def blender_mesh():
    """A square and a triangle, whose corners lie one after the other."""
    return Mesh(
        vertices=Collection(co=POINTS),
        edges=(),
        loops=Collection(vertex_index=[0, 1, 2, 3, 2, 4, 3]),
        polygons=Collection(loop_start=[0, 4], loop_total=[4, 3]),
    )


class MeshObjectsTest(unittest.TestCase):
    def expect_house(self, mesh):
        found = as_mesh(mesh, "x")
        np.testing.assert_array_equal(found.positions, POINTS)
        np.testing.assert_array_equal(found.faces, TRIANGLES)

    def test_each_kind_is_the_same_mesh(self):
        counted = [[3, *corners] for corners in TRIANGLES]
        kinds = {
            "trimesh": Mesh(vertices=POINTS, faces=np.array(TRIANGLES), triangles=POINTS),
            "Open3D": Mesh(
                vertices=Vector(POINTS), triangles=Vector(np.int32(TRIANGLES)),
                triangle_normals=Vector(np.empty((0, 3))),
            ),
            "PyVista": Mesh(points=POINTS, faces=np.ravel(counted), lines=np.empty(0, int)),
            "PyVista, a quadrilateral": Mesh(
                points=POINTS, faces=np.array([4, 0, 1, 2, 3, 3, 2, 4, 3])
            ),
            "meshio": meshio.Mesh(POINTS, {"triangle": TRIANGLES}),
            "meshio, blocks": meshio.Mesh(
                POINTS,
                [("line", [[0, 1]]), ("triangle", TRIANGLES[:1]), ("triangle", TRIANGLES[1:])],
            ),
            "meshio, a quadrilateral": meshio.Mesh(
                POINTS, [("quad", [[0, 1, 2, 3]]), ("triangle", [[2, 4, 3]])]
            ),
            "Blender, a mesh": blender_mesh(),
            "Blender, an object": Mesh(type="MESH", data=blender_mesh()),
        }  # fmt: skip
        for name, mesh in kinds.items():
            with self.subTest(name=name):
                self.expect_house(mesh)

    def test_what_is_no_surface_says_what_is_wanted(self):
        tetrahedron = meshio.Mesh(POINTS, {"tetra": [[0, 1, 2, 3]]})
        wrong = {
            "its cells are tetra, expected polygon, quad, triangle": tetrahedron,
            "its cells are none": meshio.Mesh(POINTS, []),
            ".extract_surface()": Mesh(points=POINTS, cells=np.array([4, 0, 1, 2, 3])),
            "faces[4] is 5": Mesh(points=POINTS, faces=np.array([3, 0, 1, 2, 5, 0, 1])),
            "faces[0] is -1": Mesh(points=POINTS, faces=np.array([-1, 0, 1, 2, 5])),
            "face 0 has 2 corners": Mesh(points=POINTS, faces=np.array([2, 0, 1])),
        }
        for said, mesh in wrong.items():
            with self.subTest(said=said):
                with self.assertRaises(isomatch.InvalidInput) as caught:
                    as_mesh(mesh, "y")
                self.assertIn(said, str(caught.exception))
                self.assertEqual(caught.exception.field, "y")

    def test_where_a_mesh_lies_does_not_matter(self):
        faces = np.array(TRIANGLES)
        streams = []
        for place in ([0, 0, 0], [524288, 4194304, 1024], [500000, 4500000, 120]):
            # All sums are exact.
            mesh = as_mesh((POINTS + place, faces), "x")
            near = _draco._near_origin(mesh.positions, mesh.faces).astype(float)
            np.testing.assert_array_equal(near - near[0], POINTS - POINTS[0])
            streams.append(_draco.encode(mesh.positions, mesh.faces).data)
        # Moved by a multiple of its step a mesh has the same bytes.
        self.assertEqual(*streams[:2])

    def test_other_types_are_a_type_error_that_names_what_is_taken(self):
        points = POINTS, np.array(TRIANGLES), None
        for value in (None, 7, POINTS, points, Mesh(vertices=POINTS), {"vertices": POINTS}):
            with self.subTest(type=type(value).__name__):
                with self.assertRaises(TypeError) as caught:
                    isomatch.match(value, value)
                for taken in ("(vertices, faces)", "a path", "Open3D", "PyVista", "Blender"):
                    self.assertIn(taken, str(caught.exception))
                # As all that is wrong with an input.
                self.assertIsInstance(caught.exception, isomatch.InvalidInput)


if __name__ == "__main__":
    unittest.main()
