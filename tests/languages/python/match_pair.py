"""A client in Python: match_pair.py ISOMATCH_SERVER WRITE_DRACO_PAIR.

Starts the real server on a free port, sends a mesh and the same mesh with its
vertices renamed, watches the job, downloads the map and compares it with the
renaming. Exits 0 when at least 95 % of the vertices are right and the server
stops cleanly.
"""

import hashlib
import pathlib
import re
import signal
import struct
import subprocess
import sys
import tempfile

import grpc

from isomatch.v1 import service_pb2 as pb
from isomatch.v1 import service_pb2_grpc

RIGHT_FRACTION = 0.95
TIMEOUT_SECONDS = 100


def start_server(binary, data_dir):
    """Returns the process and the address it says it listens on."""
    flags = ["--data-dir", data_dir, "--listen", "127.0.0.1:0", "--metrics-listen", "off"]
    server = subprocess.Popen([binary, *flags], stderr=subprocess.PIPE, text=True)
    for line in server.stderr:
        found = re.search(r"listens on (\S+)", line)
        if found:
            return server, found.group(1)
    raise RuntimeError("the server did not start")


def write_pair(helper, folder):
    """Returns the Draco bytes of both meshes and the true map."""
    paths = [folder / name for name in ("x.drc", "y.drc", "truth.txt")]
    subprocess.run([helper, *paths], check=True)
    truth = [int(line) for line in paths[2].read_text().split()]
    return paths[0].read_bytes(), paths[1].read_bytes(), truth


def mesh(draco, vertices):
    return pb.Mesh(
        draco=draco,
        vertex_order=pb.VERTEX_ORDER_ID_ATTRIBUTE,
        vertex_count=vertices,
    )


def watch(stub, name):
    """Returns the terminal job."""
    progress = 0
    for response in stub.WatchJob(pb.WatchJobRequest(name=name)):
        job = response.job
        assert job.progress.total_fraction >= progress, "progress fell"
        progress = job.progress.total_fraction
    assert job.state == pb.Job.STATE_SUCCEEDED, job
    return job


def download(stub, name):
    """Returns the map, checked against its digest."""
    responses = stub.DownloadResult(pb.DownloadResultRequest(name=name))
    header = next(responses).header
    data = b"".join(response.chunk for response in responses)
    assert hashlib.sha256(data).hexdigest() == header.digest.sha256
    return struct.unpack(f"<{header.vertices_x}I", data)


def match(stub, draco_x, draco_y, truth):
    """Returns the fraction of vertices whose match is right."""
    request = pb.CreateJobRequest(
        mesh_x=mesh(draco_x, len(truth)),
        mesh_y=mesh(draco_y, len(truth)),
        options=pb.MatchOptions(random_seed=1),
        request_id="match_pair.py",
    )
    job = stub.CreateJob(request).job
    assert stub.CreateJob(request).job.name == job.name, "not idempotent"
    watch(stub, job.name)
    y_from_x = download(stub, job.name)
    return sum(a == b for a, b in zip(y_from_x, truth)) / len(truth)


def main():
    binary, helper = sys.argv[1:]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        pair = write_pair(helper, folder)
        server, address = start_server(binary, folder / "data")
        try:
            with grpc.insecure_channel(address) as channel:
                stub = service_pb2_grpc.CorrespondenceServiceStub(channel)
                right = match(stub, *pair)
            server.send_signal(signal.SIGTERM)
            status = server.wait(TIMEOUT_SECONDS)
        finally:
            server.kill()
            server.wait()
    print(f"{right:.1%} of the vertices are right, server exit {status}")
    return 0 if right >= RIGHT_FRACTION and status == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
