"""Meshes that others write are the mesh that they wrote: meshio (python3-meshio), where
it is installed, and Python's own json, base64, zlib and gzip. A match of each gives the
bytes of the map that the OFF file gives.

ISOMATCH_BINARY names the command."""
import base64
import gzip
import json
import os
import pathlib
import shutil
import struct
import subprocess
import tempfile
import unittest
import zlib

ISOMATCH = os.environ["ISOMATCH_BINARY"]


def run(*arguments, stdin=None):
    return subprocess.run([ISOMATCH, *map(str, arguments)], input=stdin, check=True,
                          capture_output=True).stdout


def read_off(path):
    words = path.read_text().split()
    vertices, faces = int(words[1]), int(words[2])
    numbers = [float(word) for word in words[4:4 + 3 * vertices]]
    corners = [int(word) for word in words[4 + 3 * vertices:]]
    return ([numbers[i:i + 3] for i in range(0, 3 * vertices, 3)],
            [corners[i + 1:i + 4] for i in range(0, 4 * faces, 4)])


class Vtp:
    """Writes VTK XML as its format tells: `how` is ascii, binary, raw or base64, the
    last two appended."""

    def __init__(self, how, packed, order="<", header="I"):
        self.how, self.packed, self.order, self.header = how, packed, order, header
        self.appended = b""

    def block(self, data):
        if not self.packed:
            return struct.pack(self.order + self.header, len(data)), data
        size = 1000
        parts = [data[i:i + size] for i in range(0, len(data), size)]
        packed = [zlib.compress(part) for part in parts]
        last = len(parts[-1]) % size
        return (struct.pack(f"{self.order}{3 + len(packed)}{self.header}", len(packed), size,
                            last, *map(len, packed)), b"".join(packed))

    def array(self, name, kind, letter, numbers, components=1):
        head = f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}"'
        if self.how == "ascii":
            return f'{head} format="ascii">\n{" ".join(map(repr, numbers))}\n</DataArray>'
        header, data = self.block(struct.pack(f"{self.order}{len(numbers)}{letter}", *numbers))
        # VTK ends base64 behind the header of packed blocks, of others it does not.
        text = (base64.b64encode(header) + base64.b64encode(data) if self.packed
                else base64.b64encode(header + data))
        if self.how == "binary":
            return f'{head} format="binary">\n {text.decode()}\n</DataArray>'
        offset = len(self.appended)
        self.appended += text if self.how == "base64" else header + data
        return f'{head} format="appended" offset="{offset}"/>'

    def file(self, vertices, faces):
        order = "LittleEndian" if self.order == "<" else "BigEndian"
        header = "UInt32" if self.header == "I" else "UInt64"
        compressor = ' compressor="vtkZLibDataCompressor"' if self.packed else ""
        text = (f'<?xml version="1.0"?>\n<VTKFile type="PolyData" version="1.0" '
                f'byte_order="{order}" header_type="{header}"{compressor}>\n<PolyData>'
                f'<Piece NumberOfPoints="{len(vertices)}" NumberOfVerts="0" '
                f'NumberOfLines="0" NumberOfStrips="0" NumberOfPolys="{len(faces)}">\n'
                "<PointData/><CellData/><Points>"
                + self.array("Points", "Float64", "d", sum(vertices, []), 3)
                + "</Points><Polys>"
                + self.array("connectivity", "Int64", "q", sum(faces, []))
                + self.array("offsets", "Int32", "i",
                             [3 * (i + 1) for i in range(len(faces))])
                + "</Polys></Piece></PolyData>").encode()
        if self.appended:
            text += (f'<AppendedData encoding="{self.how}">\n_'.encode() + self.appended
                     + b"\n</AppendedData>")
        return text + b"</VTKFile>\n"


def gltf(vertices, faces, uri):
    positions = struct.pack(f"<{3 * len(vertices)}f", *sum(vertices, []))
    indices = struct.pack(f"<{3 * len(faces)}H", *sum(faces, []))
    data = positions + indices
    scene = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(data), "uri": uri or (
            "data:application/octet-stream;base64," + base64.b64encode(data).decode())}],
        "bufferViews": [{"buffer": 0, "byteLength": len(positions)},
                        {"buffer": 0, "byteOffset": len(positions),
                         "byteLength": len(indices)}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": len(vertices),
                       "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5123, "count": 3 * len(faces),
                       "type": "SCALAR"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}]}
    return json.dumps(scene), data


class ForeignFilesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        run("sample", "--vertices", 400, "-o", cls.folder / "a.off")
        run("sample", "--pose", "B", "--vertices", 300, "-o", cls.folder / "b.off")
        cls.vertices, cls.faces = read_off(cls.folder / "a.off")
        cls.map = cls.match(cls.folder / "a.off")

    @classmethod
    def match(cls, x, stdin=None):
        return run("match", x, cls.folder / "b.off", "-o", "-", "--no-progress", stdin=stdin)

    def expect_same(self, name, content):
        path = self.folder / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        with self.subTest(name):
            self.assertEqual(self.match(path), self.map)

    def test_vtk_of_meshio(self):
        try:
            import meshio
        except ImportError:
            self.skipTest("python3-meshio is not installed")
        mesh = meshio.Mesh(self.vertices, [("triangle", self.faces)])
        for version in ("vtk42", "vtk51"):
            for binary in (False, True):
                path = self.folder / f"{version}{binary}.vtk"
                meshio.write(path, mesh, file_format=version, binary=binary)
                with self.subTest(path.name):
                    self.assertEqual(self.match(path), self.map)

    def test_vtk_xml(self):
        for how in ("ascii", "binary", "raw", "base64"):
            for packed in (False, True):
                order, header = ("<", "I") if packed == (how == "raw") else (">", "Q")
                self.expect_same(f"{how}{packed}.vtp", Vtp(how, packed, order, header).file(
                    self.vertices, self.faces))

    def test_gltf(self):
        text, data = gltf(self.vertices, self.faces, "a.bin")
        (self.folder / "a.bin").write_bytes(data)
        self.expect_same("outside.gltf", text)
        self.expect_same("inside.gltf", gltf(self.vertices, self.faces, "")[0])

    def test_glb_that_isomatch_writes(self):
        run("sample", "--vertices", 400, "-o", self.folder / "a.glb")
        glb = (self.folder / "a.glb").read_bytes()
        self.assertEqual(self.match(self.folder / "a.glb"), self.map)
        magic, version, length, size, kind = struct.unpack("<4sII I4s", glb[:20])
        self.assertEqual((magic, version, length, kind), (b"glTF", 2, len(glb), b"JSON"))
        scene = json.loads(glb[20:20 + size])
        position = scene["accessors"][0]
        view = scene["bufferViews"][position["bufferView"]]
        start = 28 + size + view["byteOffset"]
        numbers = struct.unpack(f"<{3 * position['count']}f",
                                glb[start:start + view["byteLength"]])
        for axis in range(3):
            self.assertAlmostEqual(min(numbers[axis::3]), position["min"][axis])
        for found, wanted in zip(numbers, sum(self.vertices, [])):
            self.assertAlmostEqual(found, wanted, 5)

    def test_packed_and_piped(self):
        off = (self.folder / "a.off").read_bytes()
        self.expect_same("a.off.gz", gzip.compress(off))
        self.assertEqual(self.match("-", stdin=off), self.map)
        self.assertEqual(self.match("-", stdin=gzip.compress(off)), self.map)


if __name__ == "__main__":
    unittest.main()
