"""isomatch.read_mesh: files as they come, and damaged ones."""

import gzip
import struct
import unittest

import numpy as np
import support

import isomatch

# A house: a square, a roof of two triangles' height, and a vertex on no face.
VERTICES = [[0, 0, 0], [2, 0, 0], [2, 2, 0.5], [0, 2, 0], [1, 3.25, 0], [9, 9, 9]]
# The square's shorter diagonal is 1-3.
TRIANGLES = [[1, 2, 3], [1, 3, 0], [2, 4, 3]]

OFF = """OFF # a comment
6 2 0
0 0 0
2 0 0
2 2 0.5

0 2 0
1 3.25 0
9 9 9
4 0 1 2 3
3 2 4 3 255 0 0
"""

OBJ = """o house
v 0 0 0
v 2 0 0
v 2 2 \\
0.5
v 0 2 0
vt 0.5 0.5
v 1 3.25 0
f 1/1/1 2//2 \\
  3 4
l 1 2 5
p 3 \\
4
# a comment ends with its line \\
f -3 -1 -2
v 9 9 9
"""

# Two triangles with a common edge, one corner of it as -0.
STL = """solid
facet normal 0 0 1
  outer loop
    vertex 1 0 0
    vertex 0 1 0
    vertex 0 0 0
  endloop
endfacet
facet normal 0 0 1
  outer loop
    vertex 0 1 -0
    vertex 1 0 0
    vertex 1 1e0 0
  endloop
endfacet
endsolid
"""

PLY_HEADER = """ply
format {} 1.0
comment made by hand
element vertex 6
property {} x
property {} y
property {} z
property uchar red
element face {}
property list uchar int vertex_indices
end_header
"""


def ply_ascii():
    rows = "".join(f"{x} {y} {z} 7\n" for x, y, z in VERTICES)
    return (PLY_HEADER.format("ascii", *["float"] * 3, 2) + rows + "4 0 1 2 3\n3 2 4 3\n").encode()


def ply_binary(order, name, faces):
    rows = b"".join(struct.pack(order + "dddB", *vertex, 7) for vertex in VERTICES)
    lists = b"".join(struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in faces)
    return PLY_HEADER.format(name, *["double"] * 3, len(faces)).encode() + rows + lists


class ReadMeshTest(unittest.TestCase):
    def write(self, name, data):
        path = support.folder() / name
        path.write_bytes(data if isinstance(data, bytes) else data.encode())
        return path

    def expect_house(self, path):
        vertices, faces = isomatch.read_mesh(path)
        np.testing.assert_array_equal(vertices, VERTICES)
        np.testing.assert_array_equal(faces, TRIANGLES)

    def test_every_format_gives_the_same_mesh(self):
        polygons = [[0, 1, 2, 3], [2, 4, 3]]
        files = {
            "house.off": OFF,
            "house.OBJ": OBJ,
            "ascii.ply": ply_ascii(),
            "little.ply": ply_binary("<", "binary_little_endian", polygons),
            "big.ply": ply_binary(">", "binary_big_endian", polygons),
            "triangles.ply": ply_binary("<", "binary_little_endian", TRIANGLES),
            "packed.off.gz": gzip.compress(OFF.encode()),
        }
        for name, data in files.items():
            with self.subTest(name=name):
                self.expect_house(self.write(name, data))

    def test_polygons_are_cut_as_the_command_line_cuts_them(self):
        # The isolated vertex shows in the count of the unmatched.
        path = self.write("house.off", OFF)
        output = support.folder() / "house.txt"
        support.run_isomatch("match", path, path, "-o", output, "--no-progress")
        result = isomatch.match(path, path)
        self.assertEqual(support.as_map_file(result.y_from_x), output.read_bytes())
        self.assertEqual(result.info.mesh_x.faces, 3)

    def test_a_pentagon_becomes_a_fan(self):
        text = "OFF\n5 1 0\n0 0 0\n2 0 0\n3 1 0\n2 2 0\n0 2 0\n5 0 1 2 3 4\n"
        _, faces = isomatch.read_mesh(self.write("pentagon.off", text))
        self.assertEqual(faces.tolist(), [[0, 1, 2], [0, 2, 3], [0, 3, 4]])

    def test_corners_of_stl_at_one_place_become_a_vertex_in_order_of_first_use(self):
        expected = [[1, 0, 0], [0, 1, 0], [0, 0, 0], [1, 1, 0]]
        text = self.write("two.stl", STL)
        vertices, faces = isomatch.read_mesh(text)
        np.testing.assert_array_equal(vertices, expected)
        self.assertEqual(faces.tolist(), [[0, 1, 2], [1, 0, 3]])
        binary = support.write_stl(support.folder() / "binary.stl", vertices, faces)
        with self.subTest("what follows the facets is not read"):
            binary.write_bytes(binary.read_bytes() + b"more")
        vertices, faces = isomatch.read_mesh(binary)
        np.testing.assert_array_equal(vertices, expected)
        self.assertEqual(faces.tolist(), [[0, 1, 2], [1, 0, 3]])

    def test_stl_is_numbered_as_the_command_line_numbers_it(self):
        writers = {"binary": support.write_stl, "ascii": support.write_ascii_stl}
        mesh_x, mesh_y = map(isomatch.read_mesh, support.pair())
        for name, write in writers.items():
            with self.subTest(name=name):
                x = write(support.folder() / f"x-{name}.stl", *mesh_x)
                y = write(support.folder() / f"y-{name}.stl", *mesh_y)
                self.assertEqual(len(isomatch.read_mesh(x)[0]), 1000)
                self.assertEqual(
                    support.as_map_file(isomatch.match(x, y).y_from_x),
                    support.map_of_command_line(x, y),
                )

    def test_a_byte_order_mark_hides_nothing(self):
        for name, text in (("marked.obj", OBJ), ("marked.off", OFF)):
            with self.subTest(name=name):
                self.expect_house(self.write(name, text.encode("utf-8-sig")))
        vertices, _ = isomatch.read_mesh(self.write("first.obj", "\ufeff" + OBJ[len("o house\n") :]))
        np.testing.assert_array_equal(vertices, VERTICES)

    def test_damaged_files_name_the_file_and_what_was_expected(self):
        """Each that the readers refuse is tested in tests/client/files."""
        damaged = {
            "words.off": (OFF.replace("3.25", "tall"), "line 8: y of vertex 4 (0-based) is 'tall'"),
            "row.ply": (ply_ascii()[:-8], "line 19: the header claims 2 of element face"),
            "cut.ply": (ply_binary("<", "binary_little_endian", TRIANGLES)[:-3], "9 bytes are left"),
            "zero.obj": (OBJ + "f 0 1 2\n", "line 17: a face's corner is '0'"),
            "mesh.doc": ("{}", "expected a mesh: .off, .obj"),
            "cut.stl": (STL[:-20], "without `endsolid`"),
        }
        for name, (data, said) in damaged.items():
            with self.subTest(name=name):
                path = self.write(name, data)
                with self.assertRaises(isomatch.InvalidInput) as caught:
                    isomatch.read_mesh(path)
                self.assertIn(f"path: '{path}'", str(caught.exception))
                self.assertIn(said, str(caught.exception))
                self.assertEqual(caught.exception.field, "path")
                with self.assertRaisesRegex(isomatch.InvalidInput, "^y: '"):
                    isomatch.match((VERTICES[:5], TRIANGLES), path)

    def test_files_that_cannot_be_opened_are_the_errors_of_python(self):
        with self.assertRaises(FileNotFoundError):
            isomatch.read_mesh(support.folder() / "none.off")
        with self.assertRaises(IsADirectoryError):
            isomatch.match(support.folder(), support.folder())


if __name__ == "__main__":
    unittest.main()
