"""The package is for every Python from `requires-python` on, not only for Debian's."""

import ast
import asyncio
import os
import pathlib
import subprocess
import sys
import unittest
from unittest import mock

import support

import isomatch
from isomatch import _transport

PACKAGE = pathlib.Path(isomatch.__file__).parent
EXAMPLES = pathlib.Path(os.environ["ISOMATCH_EXAMPLES"])
# Imports the package where neither numpy nor gRPC need be: what it asks of them while
# it is imported answers whatever is asked.
IMPORT_ALL = """
import importlib, pathlib, sys
from unittest import mock
sys.dont_write_bytecode = True
for name in ("numpy", "numpy.typing", "grpc", "grpc.aio", "google", "google.protobuf"):
    sys.modules[name] = mock.MagicMock()
package = pathlib.Path(sys.argv[1])
sys.path.insert(0, str(package.parent))
for file in package.glob("*.py"):
    importlib.import_module(f"isomatch.{file.stem}")
for file in pathlib.Path(sys.argv[2]).glob("*.py"):
    compile(file.read_text(), str(file), "exec")
"""


class VersionsTest(unittest.TestCase):
    def test_the_oldest_python_can_parse_every_file(self):
        files = [*PACKAGE.glob("*.py"), *EXAMPLES.glob("*.py")]
        self.assertGreater(len(files), 10)
        for file in files:
            with self.subTest(file=file.name):
                tree = ast.parse(file.read_text(), feature_version=support.OLDEST_PYTHON)
                # `X | Y` in annotations is evaluated otherwise, before 3.10.
                future = [node for node in tree.body if isinstance(node, ast.ImportFrom)
                          and node.module == "__future__"]  # fmt: skip
                annotated = any(
                    getattr(node, "annotation", None) or getattr(node, "returns", None)
                    for node in ast.walk(tree)
                )
                if file.parent == PACKAGE and annotated:
                    self.assertTrue(future, "from __future__ import annotations")

    def test_each_other_python_of_this_machine_imports_the_package(self):
        """Without numpy and gRPC, which only this Python need have: that every line which
        runs on import does so, no more."""
        found = support.other_pythons()
        oldest = "{}.{}".format(*support.OLDEST_PYTHON)
        if not found:
            self.skipTest(f"no other Python here, expected one of {oldest} or later")
        print("imported by", ", ".join(sorted(found)))
        if f"python{oldest}" not in found:
            print(f"not tried: python{oldest}, the oldest that the package is for")
        for name, python in found.items():
            with self.subTest(name=name):
                script = [python, "-c", IMPORT_ALL, PACKAGE, EXAMPLES]
                answer = subprocess.run(script, capture_output=True, text=True, timeout=60)
                self.assertEqual(answer.returncode, 0, answer.stderr)

    def test_a_cancelled_task_is_told_without_the_help_of_python_3_11(self):
        class Call:
            def __init__(self, details):
                self._details = details

            def done(self):
                return True

            async def details(self):
                return self._details

        async def error_after(details):
            with mock.patch.object(asyncio, "current_task", return_value=object()):
                return await _transport.rpc_error(Call(details), asyncio.CancelledError())

        found = asyncio.run(error_after("CANCELLED"))
        self.assertIsInstance(found, isomatch.Unavailable)
        with self.assertRaises(asyncio.CancelledError):
            asyncio.run(error_after("Locally cancelled by application!"))

    def test_grpc_tells_that_its_call_was_cancelled_here(self):
        async def cancelled():
            async with _transport.grpc.aio.insecure_channel("127.0.0.1:1") as channel:
                call = channel.unary_unary("/none/None")(b"")
                call.cancel()
                return await call.details()

        self.assertEqual(asyncio.run(cancelled()), _transport._CANCELLED_HERE)


if __name__ == "__main__":
    unittest.main()
