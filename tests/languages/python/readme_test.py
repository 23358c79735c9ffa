"""The Python and Node blocks of README.md and client/README.md, run as they stand there."""

import contextlib
import io
import os
import pathlib
import subprocess
import unittest
from unittest import mock

import numpy as np
import support

import isomatch

MANUAL = pathlib.Path(os.environ["ISOMATCH_CLIENT_README"])
FRONT_PAGE = MANUAL.parents[1] / "README.md"


def replaced(text: str, old: str, new: str) -> str:
    assert old in text, old
    return text.replace(old, new)


class ReadmeTest(unittest.TestCase):
    def setUp(self):
        x, y = support.pair()
        folder = support.folder()
        for path, name in ((x, "template.ply"), (y, "scan.ply")):
            support.write_ply(folder / name, *isomatch.read_mesh(path))
        (folder / "dog.off").write_bytes(y.read_bytes())
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(folder)

    def test_the_front_page(self):
        [block] = support.blocks(FRONT_PAGE, "From other languages", "python")
        vertices_x, faces_x = isomatch.read_mesh(support.pair()[0])
        names = {"vertices_x": vertices_x, "faces_x": faces_x}
        with mock.patch("webbrowser.open", return_value=True) as opened, mock.patch.dict(
            os.environ, DISPLAY=":0"
        ):
            exec(block, names)
        opened.assert_called_once()
        self.assertEqual(
            support.as_map_file(names["result"].y_from_x),
            support.map_of_command_line(*support.pair()),
        )

    def test_the_first_page_of_python(self):
        vertices_x, faces_x = isomatch.read_mesh(support.pair()[0])
        names = {
            "vertices_x": vertices_x,
            "faces_x": faces_x,
            "values_y": np.zeros((900, 2)),
            "uv_y": np.zeros((len(isomatch.read_mesh(support.pair()[1])[1]), 3, 2)),
        }
        with mock.patch("webbrowser.open", return_value=True) as opened, mock.patch.dict(
            os.environ, DISPLAY=":0"
        ):
            exec(support.blocks(MANUAL, "Python", "python")[0], names)
        opened.assert_called_once()
        self.assertEqual(
            support.as_map_file(names["result"].y_from_x),
            support.map_of_command_line(*support.pair()),
        )

    def test_the_steps_of_python(self):
        secure = '"meshes.example.org:7443", tls_ca="ca.crt", api_key=key'
        names = {"isomatch": isomatch}
        with support.Server("--ephemeral") as server:
            [_, block] = support.blocks(MANUAL, "Python", "python")
            steps = replaced(block, secure, repr(server.address))
            with contextlib.redirect_stdout(io.StringIO()) as said:
                exec(steps, names)
        self.assertIn("JobState.SUCCEEDED", said.getvalue())
        self.assertIsNotNone(names["result"].precise)
        self.assertEqual(names["same"].name, names["job"].name)

    def test_the_commands_of_node(self):
        with support.Server("--ephemeral") as server:
            [script] = support.blocks(MANUAL, "Node", "sh")
            script = replaced(script, "cd client/node && npm ci", "set -e")
            script = replaced(script, "isomatch-server --ephemeral &\n", "")
            script = replaced(
                script,
                "node match.mjs",
                f"node {os.environ['ISOMATCH_NODE_CLIENT']}/match.mjs --server {server.address}",
            )
            binaries = pathlib.Path(support.CLIENT_BINARY).parent
            subprocess.run(
                ["bash", "-c", script],
                env={**os.environ, "PATH": f"{binaries}:{os.environ['PATH']}"},
                check=True,
                capture_output=True,
                timeout=60,
            )
        self.assertEqual(len(pathlib.Path("map.txt").read_text().split()), 2000)


if __name__ == "__main__":
    unittest.main()
