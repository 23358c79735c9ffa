"""What proto/README.md says of the numbers of vertices and of their coordinates: its
programs, compiled and run as they stand there, Draco's own tools, and the warnings of the
server."""

import os
import pathlib
import re
import subprocess
import unittest

import numpy as np
import support

import isomatch
from isomatch import _messages

MANUAL = pathlib.Path(os.environ["ISOMATCH_PROTO"]) / "README.md"
NODE_CLIENT = pathlib.Path(os.environ["ISOMATCH_NODE_CLIENT"])

# What the manual's programs are called with: counts, coordinates, corners.
CPP_MAIN = """
#include <fstream>
#include <iostream>

int main(int, char** argv) {
  std::ifstream in(argv[1]);
  std::size_t n = 0, m = 0;
  in >> n >> m;
  std::vector<std::array<double, 3>> vertices(n);
  std::vector<std::array<std::uint32_t, 3>> faces(m);
  for (auto& vertex : vertices) in >> vertex[0] >> vertex[1] >> vertex[2];
  for (auto& face : faces) in >> face[0] >> face[1] >> face[2];
  std::ofstream(argv[2], std::ios::binary) << Encode(vertices, faces);
}
"""
JS_MAIN = """
import {readFileSync, writeFileSync} from 'node:fs';
const [n, m, ...numbers] = readFileSync(process.argv[2], 'utf8').split(/\\s+/).map(Number);
const vertices = Float64Array.from(numbers.slice(0, 3 * n));
const faces = Uint32Array.from(numbers.slice(3 * n, 3 * n + 3 * m));
writeFileSync(process.argv[3], encode(vertices, faces));
"""


#: Where meshes lie: near the origin, and where single precision leaves no shape.
PLACES = [0, 0, 0], [500000, 4500000, 120]


def as_numbers(vertices, faces):
    rows = [[len(vertices), len(faces)], *vertices.tolist(), *faces.tolist()]
    return "\n".join(" ".join(map(repr, row)) for row in rows) + "\n"


def draco_encoder(path, *flags):
    out = path.with_suffix(path.suffix + ".drc")
    subprocess.run(
        ["draco_encoder", *flags, "-i", path, "-o", out], check=True, stdout=subprocess.DEVNULL
    )
    return out.read_bytes()


def write_obj(path, vertices, faces):
    path.write_text(
        "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in vertices.tolist())
        + "".join(f"f {a} {b} {c}\n" for a, b, c in (faces + 1).tolist())
    )
    return path


class NumberingTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.server = cls.enterClassContext(support.Server("--ephemeral"))
        cls.client = cls.enterClassContext(isomatch.Client(cls.server.address))
        cls.vertices, cls.faces = isomatch.read_mesh(support.sample("A", 1000))

    def match_to_itself(self, data, order, vertex_count=1000):
        """The result of matching a stream to the mesh that it was made of, as our own
        client sends that."""
        request = _messages.CreateJobRequest()
        self.client._add_meshes(request, (self.vertices, self.faces), (self.vertices, self.faces))
        request.mesh_x.draco = data
        request.mesh_x.vertex_count = vertex_count
        request.mesh_x.vertex_order = _messages.enum_number("VertexOrder", f"VERTEX_ORDER_{order}")
        request.options.random_seed = 1
        transport = self.client._transport
        name = transport.call(transport.rpcs.CreateJob, request).job.name
        return self.client.job(name).result()

    def warnings_of(self, result):
        """Of numbers and coordinates; a map may get others."""
        return [text for text in result.info.warnings if text.startswith(("mesh_x:", "mesh_y:"))]

    def expect_own_numbers(self, result):
        self.assertEqual(self.warnings_of(result), [])
        right = result.y_from_x == np.arange(1000)
        self.assertGreater(right.mean(), 0.99)

    def expect_order_warning(self, result):
        said = "mesh_x: vertex_order is not set and the mesh is encoded by edgebreaker"
        self.assertTrue(any(text.startswith(said) for text in result.info.warnings), result.info)

    def test_a_mesh_that_was_rounded_is_warned_of(self):
        far = support.write_ply(
            support.folder() / "far.ply", self.vertices + PLACES[1], self.faces
        )
        result = self.match_to_itself(draco_encoder(far, "-qp", "0", "-cl", "0"), "DECODED", 0)
        [warning] = self.warnings_of(result)
        [manual] = re.findall(r"`(mesh_x: coordinates[^`]*)`", MANUAL.read_text())
        for part in manual.split()[:-1]:
            self.assertIn(part.strip("."), warning)

    def expect_other_numbers(self, result):
        self.assertLess((result.y_from_x == np.arange(1000)).mean(), 0.1)

    def test_the_program_in_c_plus_plus_keeps_the_numbers(self):
        [text] = support.blocks(MANUAL, "Numbering", "cpp")
        folder = support.folder()
        (folder / "encode.cc").write_text(text + CPP_MAIN)
        compiler = os.environ["ISOMATCH_CXX"]
        subprocess.run(
            [compiler, "-std=c++17", "encode.cc", "-ldraco", "-o", "encode"],
            check=True, cwd=folder,
        )  # fmt: skip
        for place in PLACES:
            numbers = as_numbers(self.vertices + place, self.faces)
            (folder / "numbers.txt").write_text(numbers)
            subprocess.run([folder / "encode", "numbers.txt", "cpp.drc"], check=True, cwd=folder)
            data = (folder / "cpp.drc").read_bytes()
            self.expect_own_numbers(self.match_to_itself(data, "ID_ATTRIBUTE"))

    def test_the_program_in_javascript_keeps_the_numbers(self):
        [text] = support.blocks(MANUAL, "Numbering", "js")
        folder = support.folder() / "js"
        folder.mkdir()
        (folder / "node_modules").symlink_to(NODE_CLIENT / "node_modules")
        (folder / "encode.mjs").write_text(text + JS_MAIN)
        for place in PLACES:
            numbers = as_numbers(self.vertices + place, self.faces)
            (folder / "numbers.txt").write_text(numbers)
            subprocess.run(
                [os.environ["ISOMATCH_NODE"], "encode.mjs", "numbers.txt", "js.drc"],
                check=True, cwd=folder,
            )  # fmt: skip
            data = (folder / "js.drc").read_bytes()
            self.expect_own_numbers(self.match_to_itself(data, "ID_ATTRIBUTE"))
        # What a client gets that knows nothing of this.
        result = self.match_to_itself(data, "UNSPECIFIED")
        self.expect_other_numbers(result)
        self.expect_order_warning(result)

    def test_dracos_tool_keeps_the_order_of_a_ply_and_of_nothing_else(self):
        folder, mesh = support.folder(), (self.vertices, self.faces)
        ply = support.write_ply(folder / "numbered.ply", *mesh)
        obj = write_obj(folder / "numbered.obj", *mesh)
        stl = support.write_stl(folder / "numbered.stl", *mesh, header=b"STL")
        sequential = "-qp", "0", "-cl", "0"
        kept = self.match_to_itself(draco_encoder(ply, *sequential), "UNSPECIFIED")
        self.expect_own_numbers(kept)
        data = draco_encoder(obj, *sequential)
        self.expect_other_numbers(self.match_to_itself(data, "UNSPECIFIED"))
        result = self.match_to_itself(draco_encoder(stl, *sequential), "UNSPECIFIED", 0)
        self.assertGreater(len(result.y_from_x), 1000)
        # Its default: edgebreaker.
        result = self.match_to_itself(draco_encoder(ply, "-qp", "0"), "UNSPECIFIED")
        self.expect_other_numbers(result)
        self.expect_order_warning(result)
        silenced = self.match_to_itself(draco_encoder(ply, "-qp", "0"), "DECODED")
        self.assertEqual(self.warnings_of(silenced), [])

    def test_the_number_of_vertices_tells_when_draco_joined_some(self):
        vertices = np.vstack([self.vertices, self.vertices[:1]])
        ply = support.write_ply(support.folder() / "twice.ply", vertices, self.faces)
        data = draco_encoder(ply, "-qp", "0", "-cl", "0")
        with self.assertRaisesRegex(isomatch.InvalidInput, "1000 vertices, .* 1001"):
            self.match_to_itself(data, "DECODED", vertex_count=1001)


if __name__ == "__main__":
    unittest.main()
