"""The example in Node, against a real server."""

import contextlib
import os
import pathlib
import pty
import shutil
import signal
import subprocess
import unittest
from unittest import mock

import forwarding_server
import numpy as np
import resetting_server
import support

import isomatch
from isomatch import _messages

MATCH = pathlib.Path(os.environ["ISOMATCH_NODE_CLIENT"]) / "match.mjs"


class NodeTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.server = cls.enterClassContext(support.Server("--ephemeral"))
        cls.client = cls.enterClassContext(isomatch.Client(cls.server.address))
        cls.output = support.folder() / "node.txt"

    def start(self, *arguments, server=None, stderr=subprocess.PIPE):
        return subprocess.Popen(
            [os.environ["ISOMATCH_NODE"], MATCH, "-o", self.output,
             "--server", server or self.server.address, *map(str, arguments)],
            stdout=subprocess.PIPE, stderr=stderr, text=True,
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

    def test_a_deadline_takes_the_map_that_is_there(self):
        early = self.client.job(self.run_match(*support.pair(), "--deadline", "0.001").split()[0])
        self.assertTrue(early.status.result.ended_early)
        self.run_match(*support.pair(), "--deadline", "3600.5")
        self.assertEqual(
            self.output.read_bytes(), support.map_of_command_line(*support.pair())
        )
        self.assertIn("--deadline", self.run_match(*support.pair(), "--deadline", "0", status=2))

    def test_meshes_beyond_one_request_are_uploaded(self):
        large = support.write_ply(support.folder() / "large.ply", *support.sheet(400))
        with support.Server("--ephemeral", "--max-request-bytes=2MiB") as server:
            # The job is there, which is what the upload is for.
            arguments = (large, support.pair()[1], "--cancel-after", "0")
            self.run_match(*arguments, status=130, server=server.address)
            with isomatch.Client(server.address) as client:
                self.assertEqual(len(list(client.jobs())), 1)

    def test_a_mesh_that_went_after_its_upload_is_brought_again(self):
        x, y = support.pair()
        with (
            support.Server("--ephemeral") as server,
            forwarding_server.ForwardingServer(server.address) as between,
            isomatch.Client(server.address) as other,
        ):
            between.take_only_small_requests()
            calls = between.lose_meshes_before_the_first_job(other)
            self.run_match(x, y, server=between.address)
        self.assertEqual(len(calls), 2)
        self.assertEqual(self.output.read_bytes(), support.map_of_command_line(x, y))

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
        places = {"here": [0, 0, 0], "far": [524288, 4194304, 1024], "odd": [500000, 4500000, 120]}
        for name, place in places.items():
            # All sums are exact.
            moved = np.round(vertices * 1024) / 1024 + place
            path = support.write_ascii_stl(support.folder() / f"{name}.stl", moved, faces)
            self.run_match(path, y)
            maps.append(self.output.read_bytes())
        self.assertEqual(maps, 3 * maps[:1])

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

    def test_warnings_and_verdict_are_told(self):
        def with_a_warning(answer):
            response = _messages.WatchJobResponse.FromString(answer)
            if response.job.HasField("result"):
                response.job.result.warnings.append("it is a test")
            return response.SerializeToString()

        def of_an_older_server(answer):
            response = _messages.WatchJobResponse.FromString(answer)
            response.job.result.ClearField("verdict")
            return response.SerializeToString()

        expected = {
            with_a_warning: r"\nwarning: it is a test\nverdict: good \(.*\)\n$",
            of_an_older_server: r"\nverdict: unknown\n$",
        }
        with forwarding_server.ForwardingServer(self.server.address) as between:
            for change, said in expected.items():
                with self.subTest(change=change.__name__):
                    between.changed["WatchJob"] = change
                    answer = self.run_match(*support.pair(), server=between.address)
                    self.assertRegex(answer, said)

    def test_progress_names_stages_as_the_command_line_does(self):
        master, slave = pty.openpty()
        self.addCleanup(os.close, master)
        process = self.start(*support.pair(), stderr=slave)
        os.close(slave)
        said = b""
        with contextlib.suppress(OSError):  # that of its end
            while True:
                said += os.read(master, 4096)
        process.communicate(timeout=60)
        self.assertEqual(process.returncode, 0, said)
        self.assertRegex(said, rb"\d %  (prepare|geodesics|spectral|seeds|alignment|quality)\b")
        self.assertIn(b"100 %  succeeded", said)
        self.assertNotRegex(said, rb"STAGE_|STATE_|first_")

    def test_damaged_files_say_what_was_expected(self):
        triangle = "0 0 0\n1 0 0\n0 1 0\n"
        obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
        corner = "line 4: a face's corner is"
        ply = (
            "ply\nformat {} 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
            "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        )
        ascii_ply = ply.format("ascii")
        little = ply.format("binary_little_endian").encode()
        damaged = {
            "bad.off": (f"OFF\n3 1 0\n{triangle}3 0 1 9\n", "face 0 is [0,1,9]"),
            "faces.off": (f"OFF\n3 2 0\n{triangle}3 0 1 2\n", "face 1 (0-based) of 2: the file ends"),
            "cut.off": ("OFF\n4 1 0\n" + triangle, "vertex 3 (0-based) of 4: the file ends"),
            "row.off": (f"OFF\n3 1 0\n{triangle}3 0 1\n", "line 6: face 0 (0-based) of 1: it has 2"),
            "counts.off": ("OFF\n3 x 0\n" + triangle, "line 5: 'x' where a whole"),
            "tall.off": ("OFF\n# \n1 0 0\n0 0 tall\n", "line 4: vertex 0 (0-based) of 1: a coordinate is 'tall'"),
            "none.off": (f"OFF\n3 0 0\n{triangle}", "no faces"),
            "hex.obj": ("v 0x10 0 0\n" + obj, "line 1: a coordinate is '0x10', expected a finite number"),
            "short.obj": (obj + "\nv 1 0 \\\n\nf 1 2 3", "line 6: a coordinate is ''"),
            "half.obj": (obj + "f 1.5/2 2 3\n", f"{corner} '1.5/2'"),
            "letters.obj": (obj + "f 1 2abc 3\n", f"{corner} '2abc'"),
            "texture.obj": (obj + "f 1/a 2 3\n", f"{corner} '1/a'"),
            "back.obj": (obj + "f 1 2 -4\n", f"{corner} '-4'"),
            "rows.ply": (ascii_ply + triangle, "line 12: face 0 (0-based) of 1: the file ends"),
            "list.ply": (ascii_ply + triangle + "3 0 1\n", "line 13: face 0 (0-based) of 1: the file ends"),
            "word.ply": (ascii_ply + triangle.replace("1", "one"), "line 11: vertex 1 (0-based) of 3: a coordinate is 'one'"),
            "nan.ply": (ascii_ply + triangle.replace("1", "nan") + "3 0 1 2\n", "vertex 1 is [NaN,0,0]"),
            "cut.ply": (little + bytes(36) + b'\3' + bytes(11), "face 0 (0-based) of 1: the file ends"),
            "type.ply": (ascii_ply.replace("uchar", "byte"), "is of type byte"),
            "count.ply": (ascii_ply.replace("face 1", "face one"), "'one' where a whole"),
            "word.stl": ("solid\nfacet\nvertex 1 0 1e\n", "line 3: a coordinate is '1e'"),
        }  # fmt: skip
        # All in one process, as many would take long.
        script = """
            import {readMesh} from %r;
            for (const path of process.argv.slice(1)) {
              try {
                readMesh(path);
                console.log(path, 'is read');
              } catch (error) {
                console.log(error.message);
              }
            }""" % str(MATCH.with_name("mesh_file.mjs"))
        paths = []
        for name, (data, _) in damaged.items():
            paths.append(support.folder() / name)
            paths[-1].write_bytes(data if isinstance(data, bytes) else data.encode())
        answer = subprocess.run(
            [os.environ["ISOMATCH_NODE"], "--input-type=module", "-e", script, *paths],
            check=True, capture_output=True, text=True, timeout=60,
        )  # fmt: skip
        for path, (_, said), line in zip(paths, damaged.values(), answer.stdout.splitlines()):
            with self.subTest(path=path.name):
                self.assertTrue(line.startswith(f"{path}: "), line)
                self.assertIn(said, line)

    def test_a_byte_order_mark_hides_no_vertex(self):
        x, y = support.pair()
        vertices, faces = isomatch.read_mesh(x)
        marked = support.folder() / "marked.obj"
        text = "".join(f"v {a!r} {b!r} {c!r}\n" for a, b, c in vertices.tolist())
        text += "".join(f"f {a} {b} {c}\n" for a, b, c in (faces + 1).tolist())
        marked.write_text(text, encoding="utf-8-sig")
        self.run_match(marked, y)
        self.assertEqual(self.output.read_bytes(), support.map_of_command_line(x, y))

    def test_mistakes_are_told(self):
        x, y = support.pair()
        cut = support.folder() / "cut.stl"
        cut.write_bytes(support.write_stl(cut, *isomatch.read_mesh(x)).read_bytes()[:-1])
        self.assertIn("99883 bytes, expected 99884", self.run_match(x, cut, status=2))
        cut = support.folder() / "cut.off"
        cut.write_text(x.read_text()[:-200])
        self.assertRegex(self.run_match(cut, y, status=2), "face .* of 1996: ")
        self.assertIn("expected two meshes", self.run_match(x, status=2))
        wrong = {
            "--profile=nice": "--profile is 'nice'",
            "--output=nm.stl": "--output 'nm.stl': the extension is '.stl', expected .txt",
            "--cancel-after=soon": "--cancel-after: 'soon', expected 0 to",
        }
        for seed in ("-1", "1.5", str(2**64)):
            wrong[f"--random-seed={seed}"] = (
                f"--random-seed: '{seed}', expected a whole number from 0 to {2**64 - 1}"
            )
        for option, said in wrong.items():
            with self.subTest(option=option):
                self.assertIn(said, self.run_match(x, y, option, status=2))


if __name__ == "__main__":
    unittest.main()
