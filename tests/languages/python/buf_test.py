"""The `buf curl` recipes of proto/README.md, run as they stand there."""

import os
import pathlib
import subprocess
import unittest

import numpy as np
import support

import isomatch

MANUAL = pathlib.Path(os.environ["ISOMATCH_MANUAL"])
ADDRESS = "127.0.0.1:7443"


def recipes():
    """The blocks of shell lines, of which the first defines api."""
    return support.blocks(MANUAL, "From a shell", "sh")


class BufTest(unittest.TestCase):
    def test_the_recipes_of_the_manual_work(self):
        folder = support.folder()
        x, y = support.pair()
        for path, name in ((x, "x.ply"), (y, "y.ply")):
            support.write_ply(folder / name, *isomatch.read_mesh(path))
        path = f"{os.environ['ISOMATCH_BUF']}:{os.environ['PATH']}"
        with support.Server("--ephemeral") as server:
            script = "set -euo pipefail\n" + "".join(recipes())
            process = subprocess.run(
                ["bash", "-c", script.replace(ADDRESS, server.address)],
                env={**os.environ, "PATH": path, "HOME": str(folder)},
                cwd=folder,
                capture_output=True,
                text=True,
                timeout=60,
            )
        said = process.stdout + process.stderr
        self.assertEqual(process.returncode, 0, said)
        for expected in (
            "isomatch.v1.CorrespondenceService/WatchJob",
            '"SERVING"',
            '"maxRequestBytes"',
            '"STATE_SUCCEEDED"',
            '"chunk"',
            "no job jobs/none",
        ):
            self.assertIn(expected, said)
        self.assertEqual(
            (folder / "map.txt").read_bytes(), support.map_of_command_line(x, y)
        )

    def test_a_mesh_that_draco_does_not_take_stops_the_recipe(self):
        folder = support.folder() / "double"
        folder.mkdir()
        vertices = b"".join(np.float64(range(3 * v, 3 * v + 3)).tobytes() for v in range(3))
        header = (
            "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty double x\n"
            "property double y\nproperty double z\nelement face 1\n"
            "property list uchar int vertex_indices\nend_header\n"
        )
        face = b"\3" + np.int32([0, 1, 2]).tobytes()
        for name in ("x.ply", "y.ply"):
            (folder / name).write_bytes(header.encode() + vertices + face)
            # Of an earlier run.
            (folder / f"{name}.drc").write_bytes(b"stale")
        calls = 'api() { echo "api $*"; cat; }\n'
        for options in ("", "set -euo pipefail\n"):
            with self.subTest(options=options):
                process = subprocess.run(
                    ["bash", "-c", options + calls + recipes()[1]],
                    cwd=folder, capture_output=True, text=True, timeout=60,
                )  # fmt: skip
                self.assertNotEqual(process.returncode, 0)
                self.assertIn("must be of type float32", process.stderr)
                self.assertNotIn("api ", process.stdout)
                self.assertFalse((folder / "map.txt").exists())


if __name__ == "__main__":
    unittest.main()
