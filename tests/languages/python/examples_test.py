"""Each page of client/python/examples runs and does what it says."""

import json
import os
import pathlib
import subprocess
import sys
import unittest

import numpy as np
import support

import isomatch

EXAMPLES = pathlib.Path(os.environ["ISOMATCH_EXAMPLES"])


class ExamplesTest(unittest.TestCase):
    run_examples: set[str] = set()

    def run_example(self, name, *arguments, status=0, **environment):
        """Returns what it prints, after the status was checked."""
        self.run_examples.add(name)
        process = subprocess.run(
            [sys.executable, EXAMPLES / name, *map(str, arguments)],
            env={**os.environ, **environment},
            capture_output=True,
            text=True,
            timeout=120,
        )
        self.assertEqual(process.returncode, status, process.stderr)
        return process.stdout

    def test_match_two_files(self):
        output = support.folder() / "two_files.txt"
        said = self.run_example("match_two_files.py", *support.pair(), output)
        self.assertIn("1000 of 1000 vertices matched", said)
        self.assertEqual(output.read_bytes(), support.map_of_command_line(*support.pair()))

    def test_template_to_many(self):
        folder = support.folder() / "many"
        folder.mkdir()
        template, other = support.pair()
        bad = folder / "bad.off"
        bad.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n")
        third = support.sample("C", 900)
        said = self.run_example(
            "template_to_many.py", template, folder, other, bad, third, status=1
        )
        self.assertIn("y: '", said)
        self.assertIn("face 0 (0-based) names vertex", said)
        written = np.load(folder / f"{other.stem}.npy")
        self.assertEqual(
            support.as_map_file(written), support.map_of_command_line(template, other)
        )
        self.assertEqual(len(np.load(folder / f"{third.stem}.npy")), 1000)
        # The template as the other mesh: its faces, near the other's surface.
        laid, faces = isomatch.read_mesh(folder / f"{other.stem}.ply")
        np.testing.assert_array_equal(faces, isomatch.read_mesh(template)[1])
        images = isomatch.read_mesh(other)[0][written]
        self.assertLess(np.linalg.norm(laid - images, axis=1).max(), 0.2)
        self.assertLess(np.linalg.norm(laid - images, axis=1).mean(), 0.04)

    def test_landmarks(self):
        pairs = support.folder() / "pairs.txt"
        true = support.truth()
        pairs.write_text(f"7 {true[7]}\n300 {true[300]}\n500 {true[20]}\n")
        said = self.run_example("landmarks.py", *support.pair(), pairs)
        self.assertIn(f"7 -> {true[7]}: kept", said)
        self.assertIn(f"500 -> {true[20]}: contradicted, the map says", said)
        pairs.write_text("7 900\n")
        self.run_example("landmarks.py", *support.pair(), pairs, status=1)

    def test_transfer_texture(self):
        output = support.folder() / "painted.ply"
        x, y = support.pair()
        self.run_example("transfer_texture.py", x, y, output)
        lines = output.read_text().splitlines()
        body = lines.index("end_header") + 1
        rows = np.array([line.split() for line in lines[body : body + 1000]], dtype=float)
        vertices, faces = isomatch.read_mesh(output)
        np.testing.assert_allclose(vertices, isomatch.read_mesh(x)[0], atol=1e-4)
        np.testing.assert_array_equal(faces, isomatch.read_mesh(x)[1])
        # The stripes and coordinates of Y at the true images of X's vertices.
        places = isomatch.read_mesh(y)[0]
        sys.path.insert(0, str(EXAMPLES))
        import transfer_texture

        true = support.truth()
        same = (rows[:, 5:] == transfer_texture.paint(places)[true]).all(axis=1)
        self.assertGreater(same.mean(), 0.9)
        off = np.abs(rows[:, 3:5] - transfer_texture.unwrap(places)[true]).max(axis=1)
        self.assertLess(np.median(off), 0.03)

    def test_from_pyfm(self):
        said = self.run_example("from_pyfm.py", *support.pair())
        self.assertIn("p2p_21: 1000 vertices of X", said)
        self.assertIn("FM_12: (30, 30)", said)

    def test_from_trimesh(self):
        """With one that loads and writes as trimesh does, which Debian does not have."""
        output = support.folder() / "fitted.ply"
        x, y = support.pair()
        said = self.run_example(
            "from_trimesh.py", x, y, output,
            PYTHONPATH=f"{pathlib.Path(__file__).parent / 'stand_ins'}:{os.environ['PYTHONPATH']}",
        )  # fmt: skip
        self.assertIn("1000 vertices of X where they lie on Y", said)
        fitted, faces = isomatch.read_mesh(output)
        np.testing.assert_array_equal(faces, isomatch.read_mesh(x)[1])
        true = isomatch.read_mesh(y)[0][support.truth()]
        self.assertLess(np.median(np.linalg.norm(fitted - true, axis=1)), 0.05)

    def test_from_slicer(self):
        x, y = support.pair()
        vertices = isomatch.read_mesh(x)[0]
        chosen = [7, 300, 650]
        markups = {
            "markups": [
                {
                    "type": "Fiducial",
                    "coordinateSystem": "LPS",
                    "controlPoints": [
                        {"id": str(i), "label": f"F-{i}", "position": vertices[i].tolist()}
                        for i in chosen
                    ],
                }
            ]
        }
        given, output = support.folder() / "points.mrk.json", support.folder() / "carried.mrk.json"
        given.write_text(json.dumps(markups))
        said = self.run_example("from_slicer.py", x, y, given, output)
        self.assertIn("F-300", said)
        points = json.loads(output.read_text())["markups"][0]["controlPoints"]
        self.assertEqual([point["label"] for point in points], ["F-7", "F-300", "F-650"])
        true = isomatch.read_mesh(y)[0][support.truth()[chosen]]
        off = np.linalg.norm([point["position"] for point in points] - true, axis=1)
        self.assertLess(off.max(), 0.2)

    def test_watch_from_another_process(self):
        name = "watch_from_another_process.py"
        output = support.folder() / "fetched.txt"
        with support.Server("--ephemeral") as server:
            known = {"ISOMATCH_SERVER": server.address}
            job = self.run_example(name, "start", *support.pair(), **known).strip()
            self.assertIn(f"{job}  SUCCEEDED", self.run_example(name, "watch", **known))
            self.assertIn(job, self.run_example(name, "fetch", output, **known))
        self.assertEqual(output.read_bytes(), support.map_of_command_line(*support.pair()))

    @classmethod
    def tearDownClass(cls):
        # One without a test would rot.
        there = {path.name for path in EXAMPLES.glob("*.py")}
        assert there == cls.run_examples, there ^ cls.run_examples


if __name__ == "__main__":
    unittest.main()
