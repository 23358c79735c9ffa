"""What goes wrong, by class, reason and field; and who is let in."""

import pathlib
import subprocess
import time
import unittest

import numpy as np
import support

import isomatch
from isomatch import _draco, _messages, _requests
from isomatch.mesh import as_mesh

SQUARE = (np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.1]]), np.array([[0, 1, 2], [0, 2, 3]]))


def square(vertices=SQUARE[0], faces=SQUARE[1]):
    return vertices, faces


class InvalidInputTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.server = cls.enterClassContext(support.Server("--ephemeral"))
        cls.client = cls.enterClassContext(isomatch.Client(cls.server.address))

    def expect_field(self, field, *arguments, **options):
        with self.assertRaises(isomatch.InvalidInput) as caught:
            self.client.submit(*arguments, **options)
        self.assertEqual(caught.exception.field, field)
        self.assertIn(field, str(caught.exception))
        return str(caught.exception)

    def test_wrong_meshes_name_their_field(self):
        said = self.expect_field("x.faces[1]", square(faces=[[0, 1, 2], [0, 2, 4]]), square())
        self.assertIn("[0, 2, 4], expected vertices 0 to 3", said)
        self.expect_field("y.faces[0]", square(), square(faces=[[0, 1, -1]]))
        self.expect_field("y.faces", square(), square(faces=[[0.0, 1.0, 2.0]]))
        self.expect_field("x.faces", square(faces=[[0, 1, 2, 3]]), square())
        self.expect_field("x.vertices", square(vertices=SQUARE[0][:, :2]), square())
        self.expect_field("x.vertices[2]", square(SQUARE[0] * [[1], [1], [np.nan], [1]]), square())
        self.expect_field("x.vertices[1]", square(SQUARE[0] * [[1], [1e60], [1], [1]]), square())
        document = support.folder() / "mesh.doc"
        document.write_text("{}")
        self.expect_field("x", document, square())
        self.expect_field("y", square(), 7)

    def test_wrong_options_name_their_field(self):
        self.expect_field("landmarks[1].y", square(), square(), landmarks=[(0, 0), (1, 4)])
        self.expect_field("landmarks", square(), square(), landmarks=[0, 1])
        self.expect_field("profile", square(), square(), profile="quick")
        self.expect_field("random_seed", square(), square(), random_seed=-1)
        # These the server finds.
        self.expect_field("priority", square(), square(), priority=101)
        self.expect_field("run_timeout", square(), square(), run_timeout=0)

    def test_the_server_says_what_is_wrong(self):
        with self.assertRaises(isomatch.InvalidInput) as caught:
            self.client.submit(square(), square(), landmarks=[(0, 0), (0, 1)])
        self.assertEqual(caught.exception.reason, "LANDMARKS_CONTRADICT")
        self.assertEqual(caught.exception.code, "INVALID_ARGUMENT")
        self.assertIsInstance(caught.exception, ValueError)
        flat = square(vertices=np.zeros((4, 3)))
        with self.assertRaises(isomatch.InvalidInput) as caught:
            self.client.submit(square(), flat)
        self.assertEqual(caught.exception.reason, "MESH_MALFORMED")
        self.assertEqual(caught.exception.field, "y")

    def test_unknown_jobs_are_not_found_at_once(self):
        start = time.monotonic()
        with self.assertRaises(isomatch.NotFound) as caught:
            self.client.job("jobs/none")
        self.assertEqual(caught.exception.reason, "JOB_NOT_FOUND")
        self.assertIsInstance(caught.exception, LookupError)
        # Only what may pass is tried again, for ten seconds.
        self.assertLess(time.monotonic() - start, 5)

    def test_a_failed_job_says_why(self):
        job = self.client.submit(*support.slow_pair(), **support.SLOW, run_timeout=0.1)
        with self.assertRaises(isomatch.JobFailed) as caught:
            job.result()
        self.assertEqual(caught.exception.reason, "RUN_TIMEOUT")
        self.assertEqual(caught.exception.code, "DEADLINE_EXCEEDED")

    def test_a_running_job_is_not_deleted(self):
        job = self.client.submit(*support.slow_pair(), **support.SLOW)
        with self.assertRaises(isomatch.FailedPrecondition) as caught:
            job.delete()
        self.assertEqual(caught.exception.reason, "JOB_NOT_TERMINAL")
        job.cancel()

    def test_a_full_queue_says_when_to_come_back(self):
        flags = ("--ephemeral", "--max-queued-jobs=1", "--workers=1")
        with support.Server(*flags) as server, isomatch.Client(server.address) as client:
            with self.assertRaises(isomatch.ResourceExhausted) as caught:
                for _ in range(3):
                    client.submit(*support.slow_pair(), **support.SLOW)
        self.assertEqual(caught.exception.reason, "QUEUE_FULL")
        self.assertGreater(caught.exception.retry_after, 0)


class DracoTest(unittest.TestCase):
    """Streams of every width of indices arrive as they left."""

    @classmethod
    def setUpClass(cls):
        cls.server = cls.enterClassContext(support.Server("--ephemeral"))
        cls.client = cls.enterClassContext(isomatch.Client(cls.server.address))

    def test_areas_arrive(self):
        # One, two, and one to three bytes an index.
        for side in (12, 40, 260):
            with self.subTest(side=side):
                vertices, faces = support.sheet(side)
                job = self.client.submit((vertices, faces), support.sheet(20))
                summary = job.result().info.mesh_x
                a, b, c = (vertices[faces[:, i]].astype(float) for i in range(3))
                area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
                self.assertEqual((summary.vertices, summary.faces), (side**2, len(faces)))
                self.assertAlmostEqual(summary.area / area, 1, places=9)

    def test_indices_are_as_wide_as_the_points_ask_for(self):
        faces = np.array([[0, 127, 128], [300, 16383, 16384]], dtype=np.uint32)
        varints = b"\x00\x7f\x80\x01" + b"\xac\x02\xff\x7f\x80\x80\x01"
        self.assertEqual(_draco._indices(faces, 65536), varints)
        self.assertEqual(_draco._indices(faces, (1 << 21) - 1), varints)
        self.assertEqual(_draco._indices(faces, 1 << 21), faces.astype("<u4").tobytes())
        self.assertEqual(_draco._indices(faces, 65535), faces.astype("<u2").tobytes())
        self.assertEqual(_draco._indices(faces[:1], 255), b"\x00\x7f\x80")

    def test_damaged_streams_are_refused(self):
        mesh = as_mesh(SQUARE, "mesh")
        encoded = _draco.encode(mesh.positions, mesh.faces)
        request = _messages.CreateJobRequest(validate_only=True)
        for message in (request.mesh_x, request.mesh_y):
            _requests.set_mesh(message, encoded)
        transport = self.client._transport
        transport.call(transport.rpcs.CreateJob, request)
        request.mesh_y.draco = encoded.data[:-1]
        with self.assertRaises(isomatch.InvalidInput) as caught:
            transport.call(transport.rpcs.CreateJob, request)
        self.assertEqual(caught.exception.field, "y.draco")


class AccessTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = support.folder()
        cls.certificate = folder / "server.crt"
        cls.keys = folder / "keys.txt"
        subprocess.run(
            ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256",
             "-nodes", "-days", "1", "-subj", "/CN=localhost",
             "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1",
             "-keyout", folder / "server.key", "-out", cls.certificate],
            check=True, capture_output=True,
        )  # fmt: skip
        cls.key = cls.new_key("alice", "submit")
        cls.viewer = cls.new_key("viewer", "read")
        cls.server = cls.enterClassContext(
            support.Server(
                "--ephemeral",
                f"--tls-cert={cls.certificate}",
                f"--tls-key={folder / 'server.key'}",
                f"--api-keys={cls.keys}",
            )
        )

    @classmethod
    def new_key(cls, name, role):
        """Returns a key that the server will know."""
        command = [support.SERVER_BINARY, "--new-api-key", name, "--tenant", "lab", "--role", role]
        made = subprocess.run(command, check=True, capture_output=True, text=True)
        with pathlib.Path(cls.keys).open("a", encoding="ascii") as file:
            file.write(made.stdout)
        return made.stderr.strip().splitlines()[-1]

    def client(self, **options):
        client = isomatch.Client(self.server.address, patience=1, **options)
        self.addCleanup(client.close)
        return client

    def test_with_certificate_and_key_a_job_runs(self):
        client = self.client(tls_ca=self.certificate, api_key=self.key)
        self.assertEqual(client.info().tenant, "lab")
        result = isomatch.match(*support.pair(), server=client)
        self.assertEqual(
            support.as_map_file(result.y_from_x), support.map_of_command_line(*support.pair())
        )

    def test_others_are_refused(self):
        with self.assertRaises(isomatch.AccessDenied) as caught:
            self.client(tls_ca=self.certificate).info()
        self.assertEqual(caught.exception.reason, "API_KEY_MISSING")
        with self.assertRaises(isomatch.AccessDenied) as caught:
            viewer = self.client(tls_ca=self.certificate, api_key=self.viewer)
            viewer.submit(*support.pair())
        self.assertEqual(caught.exception.reason, "ROLE_TOO_LOW")
        with self.assertRaises(isomatch.Unavailable):
            self.client(api_key=self.key).info()
        with self.assertRaises(isomatch.InvalidInput):
            self.client(tls_cert=self.certificate)


if __name__ == "__main__":
    unittest.main()
