"""The `buf curl` recipes of proto/README.md, run as they stand there."""

import os
import pathlib
import subprocess
import unittest

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


if __name__ == "__main__":
    unittest.main()
