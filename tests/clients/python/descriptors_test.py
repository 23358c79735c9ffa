"""service.binpb, which the package reads the API from, is that of service.proto."""

import importlib.resources
import os
import pathlib
import subprocess
import unittest

import support
from google.protobuf import any_pb2, descriptor_pb2, descriptor_pool, duration_pb2

import isomatch

FILES = [
    "isomatch/v1/service.proto",
    "google/rpc/status.proto",
    "google/rpc/error_details.proto",
]


class DescriptorsTest(unittest.TestCase):
    def test_the_committed_descriptors_are_those_of_the_proto(self):
        path = support.folder() / "service.binpb"
        proto = pathlib.Path(os.environ["ISOMATCH_PROTO"])
        subprocess.run(
            [os.environ["ISOMATCH_PROTOC"], f"--proto_path={proto}", "--include_imports",
             f"--descriptor_set_out={path}", *FILES],
            check=True,
        )  # fmt: skip
        packaged = importlib.resources.files("isomatch").joinpath("service.binpb")
        sets = [
            descriptor_pb2.FileDescriptorSet.FromString(data)
            for data in (path.read_bytes(), packaged.read_bytes())
        ]
        self.assertEqual(
            *sets, "build the target python_descriptors and commit client/python/isomatch"
        )

    def test_stubs_of_the_same_files_do_not_clash(self):
        # As another package of the user's program may have them, of another age.
        data = importlib.resources.files("isomatch").joinpath("service.binpb").read_bytes()
        # What those import, and the package is there already.
        self.assertTrue(any_pb2.DESCRIPTOR and duration_pb2.DESCRIPTOR and isomatch.match)
        for file in descriptor_pb2.FileDescriptorSet.FromString(data).file:
            if file.package == "google.rpc":
                file.message_type[0].field.add(name="newer", number=99, type=9, label=1)
                descriptor_pool.Default().AddSerializedFile(file.SerializeToString())
        found = descriptor_pool.Default().FindMessageTypeByName("google.rpc.Status")
        self.assertIn("newer", found.fields_by_name)


if __name__ == "__main__":
    unittest.main()
