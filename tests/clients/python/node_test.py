"""The example in Node, against a real server."""

import os
import pathlib
import shutil
import signal
import subprocess
import unittest
from unittest import mock

import numpy as np
import resetting_server
import support

import isomatch

MATCH = pathlib.Path(os.environ["ISOMATCH_NODE_CLIENT"]) / "match.mjs"


class NodeTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.server = cls.enterClassContext(support.Server("--ephemeral"))
        cls.client = cls.enterClassContext(isomatch.Client(cls.server.address))
        cls.output = support.folder() / "node.txt"

    def start(self, *arguments, server=None):
        return subprocess.Popen(
            [os.environ["ISOMATCH_NODE"], MATCH, *map(str, arguments), "-o", self.output,
             "--server", server or self.server.address],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    def run_match(self, *arguments, status=0, server=None):
        """Returns what it prints on stderr, after the status was checked."""
        process = self.start(*arguments, server=server)
        _, said = process.communicate(timeout=120)
        self.assertEqual(process.returncode, status, said)
        return said

    def test_the_map_is_that_of_the_command_line(self):
        # The second pair is decimated, which depends on the order of faces.
        for x, y in (support.pair(), (support.sample("A", 1000), support.sample("C", 6000))):
            self.run_match(x, y)
            self.assertEqual(self.output.read_bytes(), support.map_of_command_line(x, y))

    def test_meshes_beyond_one_request_are_uploaded(self):
        large = support.write_ply(support.folder() / "large.ply", *support.sheet(400))
        with support.Server("--ephemeral", "--max-request-bytes=2MiB") as server:
            # The job is there, which is what the upload is for.
            arguments = (large, support.pair()[1], "--cancel-after", "0")
            self.run_match(*arguments, status=130, server=server.address)
            with isomatch.Client(server.address) as client:
                self.assertEqual(len(list(client.jobs())), 1)

    def test_obj_and_ply_give_what_off_gives(self):
        x, y = support.pair()
        vertices, faces = isomatch.read_mesh(x)
        obj = support.folder() / "x.obj"
        obj.write_text(
            "".join(f"v {a!r} {b!r} {c!r}\n" for a, b, c in vertices.tolist())
            + "l 1 2\np 3 \\\n 4\n"
            + "".join(f"f {a}/1 {b}/2 \\\n{c}/3\n" for a, b, c in (faces + 1).tolist())
        )
        ply = support.folder() / "y.ply"
        support.run_isomatch("sample", "--pose", "B", "--vertices", "900", "-o", ply)
        self.run_match(obj, ply)
        self.assertEqual(self.output.read_bytes(), support.map_of_command_line(x, y))

    def test_a_copy_of_its_folder_runs(self):
        folder = support.folder() / "copied"
        folder.mkdir()
        for file in MATCH.parent.iterdir():
            if file.is_file():
                shutil.copy(file, folder)
        # What npm ci brings.
        (folder / "node_modules").symlink_to(MATCH.parent / "node_modules")
        with mock.patch(f"{__name__}.MATCH", folder / "match.mjs"):
            self.run_match(*support.pair())
        self.assertEqual(self.output.read_bytes(), support.map_of_command_line(*support.pair()))

    def test_where_a_mesh_lies_does_not_matter(self):
        x, y = support.pair()
        vertices, faces = isomatch.read_mesh(x)
        maps = []
        for name, place in (("here", [0, 0, 0]), ("far", [524288, 4194304, 1024])):
            # Both sums are exact.
            moved = np.round(vertices * 1024) / 1024 + place
            path = support.write_ascii_stl(support.folder() / f"{name}.stl", moved, faces)
            self.run_match(path, y)
            maps.append(self.output.read_bytes())
        self.assertEqual(*maps)

    def test_stl_is_numbered_as_the_command_line_numbers_it(self):
        mesh_x, mesh_y = map(isomatch.read_mesh, support.pair())
        x = support.write_stl(support.folder() / "node-x.stl", *mesh_x)
        y = support.write_ascii_stl(support.folder() / "node-y.stl", *mesh_y)
        self.run_match(x, y)
        self.assertEqual(self.output.read_bytes(), support.map_of_command_line(x, y))

    def test_cancelling_ends_the_job_on_the_server(self):
        for how in ("after", "signal"):
            with self.subTest(how=how):
                self.output.unlink(missing_ok=True)
                arguments = [*support.slow_pair(), "--profile", "paper"]
                if how == "after":
                    arguments += ["--cancel-after", "0.2"]
                process = self.start(*arguments)
                name = process.stderr.readline().strip()
                if how == "signal":
                    process.send_signal(signal.SIGINT)
                self.assertEqual(process.wait(60), 130)
                process.communicate()
                state = self.client.job(name).status.state
                self.assertIs(state, isomatch.JobState.CANCELLED)
                self.assertFalse(self.output.exists())

    def test_a_watch_goes_on_after_the_server_was_killed(self):
        data = support.folder() / "node-data"
        with support.Server(f"--data-dir={data}") as server:
            process = self.start(*support.pair(), server=server.address)
            name = process.stderr.readline().strip()
            server.kill()
            server.start()
            _, said = process.communicate(timeout=60)
            self.assertEqual(process.returncode, 0, said)
            with isomatch.Client(server.address) as client:
                self.assertIs(client.job(name).status.state, isomatch.JobState.SUCCEEDED)
        self.assertEqual(self.output.read_bytes(), support.map_of_command_line(*support.pair()))

    def test_a_stream_that_is_reset_is_tried_again(self):
        internal_error = 2
        with resetting_server.ResettingServer(internal_error) as server:
            process = self.start(*support.pair(), server=server.address)
            self.assertTrue(server.wait_for_streams(2, seconds=30))
            process.kill()
            process.communicate()

    def test_mistakes_are_told(self):
        x, y = support.pair()
        bad = support.folder() / "bad.off"
        bad.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n")
        self.assertIn("face 0 is [0,1,9]", self.run_match(x, bad, status=2))
        cut = support.folder() / "cut.stl"
        cut.write_bytes(support.write_stl(cut, *isomatch.read_mesh(x)).read_bytes()[:-1])
        self.assertIn("99883 bytes, expected 99884", self.run_match(x, cut, status=2))
        self.assertIn("expected two meshes", self.run_match(x, status=2))
        self.assertIn("'nice'", self.run_match(x, y, "--profile", "nice", status=2))


if __name__ == "__main__":
    unittest.main()
