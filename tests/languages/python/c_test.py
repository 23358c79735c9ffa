"""libisomatch.so.0 as its users get it: installed, built against by a C compiler alone
and by CMake's find_package, and what it shows to the linker."""

import ctypes
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

BUILD = os.environ["ISOMATCH_BUILD"]
CMAKE = os.environ["ISOMATCH_CMAKE"]
EXAMPLES = pathlib.Path(os.environ["ISOMATCH_C_EXAMPLES"])
COMMAND_LINE = os.environ["ISOMATCH_BINARY"]


def run(*command, status=0, **options):
    """Returns what it prints; a failure shows what it said."""
    process = subprocess.run(
        list(map(str, command)), capture_output=True, text=True, timeout=120, **options
    )
    if process.returncode != status:
        raise AssertionError(f"{' '.join(map(str, command))}\n{process.stdout}{process.stderr}")
    return process.stdout


class CTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.prefix = cls.folder / "prefix"
        for component in ("library", "sdk"):
            run(CMAKE, "--install", BUILD, "--component", component, "--prefix", cls.prefix)
        [cls.library] = cls.prefix.rglob("libisomatch.so.0")
        cls.loaded = {**os.environ, "LD_LIBRARY_PATH": str(cls.library.parent)}
        for pose in "AB":
            run(COMMAND_LINE, "sample", "--pose", pose, "--vertices", "5000",
                "-o", cls.folder / f"{pose}.off")  # fmt: skip

    def match_with(self, program):
        a, b = self.folder / "A.off", self.folder / "B.off"
        mapped = run(program, a, b, env=self.loaded)
        run(COMMAND_LINE, "match", a, b, "-o", self.folder / "map.txt", "--no-progress")
        self.assertEqual(mapped, (self.folder / "map.txt").read_text())

    def expect_that_it_is_missing(self, *command):
        process = subprocess.run(
            command, capture_output=True, text=True, timeout=120, env=self.loaded
        )
        self.assertEqual(process.returncode, 1, process.stderr)
        self.assertIn("none.off': no such file", process.stderr)

    def test_a_c_compiler_is_enough(self):
        program = self.folder / "match"
        run("cc", "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror",
            f"-I{self.prefix / 'include'}", EXAMPLES / "match.c",
            f"-L{self.library.parent}", "-lisomatch", "-o", program)  # fmt: skip
        self.match_with(program)
        self.expect_that_it_is_missing(program, self.folder / "none.off", self.folder / "B.off")

    def test_cpp_takes_the_same_header(self):
        program = self.folder / "template_to_many"
        run("c++", "-std=c++17", "-Wall", "-Wextra", "-Wpedantic", "-Werror",
            f"-I{self.prefix / 'include'}", EXAMPLES / "template_to_many.cc",
            f"-L{self.library.parent}", "-lisomatch", "-o", program)  # fmt: skip
        a, b = self.folder / "A.off", self.folder / "B.off"
        said = run(program, a, b, a, env=self.loaded).splitlines()
        first = self.folder / "map.txt"
        run(COMMAND_LINE, "match", a, b, "-o", first, "--no-progress")
        self.assertEqual(said[0], f"{b}: good, first vertex goes to {first.read_text().split()[0]}")
        self.assertEqual(said[1], f"{a}: good, first vertex goes to 0")
        self.expect_that_it_is_missing(program, a, self.folder / "none.off")

    def test_lua_calls_it_by_its_header(self):
        program = self.folder / "match-lua"
        script = EXAMPLES / "match.lua"
        program.write_text(f'#!/bin/sh\nexec luajit {script} "$@"\n')
        program.chmod(0o755)
        self.loaded["ISOMATCH_HEADER"] = str(self.prefix / "include/isomatch.h")
        self.match_with(program)
        self.expect_that_it_is_missing(program, self.folder / "none.off", self.folder / "B.off")

    def test_find_package_gives_the_core_alone(self):
        project = self.folder / "project"
        project.mkdir()
        shutil.copy(EXAMPLES / "match.c", project)
        (project / "CMakeLists.txt").write_text(
            "cmake_minimum_required(VERSION 3.25)\n"
            "project(it LANGUAGES C)\n"  # without C++, gRPC would not be found
            "find_package(isomatch 0.1 CONFIG REQUIRED COMPONENTS core)\n"
            "add_executable(match match.c)\n"
            "target_link_libraries(match PRIVATE isomatch::core)\n"
        )
        run(CMAKE, "-S", project, "-B", project / "build", f"-DCMAKE_PREFIX_PATH={self.prefix}")
        run(CMAKE, "--build", project / "build")
        self.match_with(project / "build/match")

    def test_only_its_own_names_are_shown(self):
        header = (self.prefix / "include/isomatch.h").read_text()
        declared = set(re.findall(r"\b(isomatch_[a-z_0-9]+)\(", header))
        shown = {
            line.split()[2].partition("@")[0]
            for line in run("nm", "-D", "--defined-only", self.library).splitlines()
        }
        self.assertEqual(shown - {"ISOMATCH_0"}, declared)

    def test_the_abi_only_grows(self):
        """Functions and types of client/c/isomatch.abi are there and as they were.

        After functions were added: ISOMATCH_WRITE_ABI=1 records them, too.
        """
        recorded, found = EXAMPLES.parent / "isomatch.abi", self.folder / "found.abi"
        run("abidw", "--exported-interfaces-only", "--drop-private-types",
            "--header-file", "isomatch.h", "--no-corpus-path", "--no-comp-dir-path",
            "--no-show-locs", "--no-elf-needed", "--out-file", found, self.library,
            cwd=EXAMPLES.parent)  # fmt: skip
        found.write_text(re.sub(r" path='[^']*'", "", found.read_text()))
        self.assertIn("<class-decl name='isomatch_pair' size-in-bits=", found.read_text())
        run("abidiff", "--no-added-syms", recorded, found)
        if os.environ.get("ISOMATCH_WRITE_ABI"):
            shutil.copy(found, recorded)
        # Nothing that was added goes unrecorded, or it could be taken away unseen.
        run("abidiff", recorded, found)

    def test_who_closes_it_after_a_match_goes_on(self):
        """Its threads are still there then."""
        program = (
            "import _ctypes, ctypes, sys, time\n"
            "library = ctypes.CDLL(sys.argv[1])\n"
            "class Pair(ctypes.Structure):\n"
            "    _fields_ = [(name, ctypes.c_void_p) for name in ('mesh_x', 'shape_x', 'mesh_y', 'shape_y', 'landmarks')]\n"
            "    _fields_ += [('num_landmarks', ctypes.c_int64)]\n"
            "file, result, error = (ctypes.c_void_p() for _ in range(3))\n"
            "assert library.isomatch_mesh_file_read(sys.argv[2].encode(), ctypes.byref(file), None) == 0\n"
            "library.isomatch_mesh_file_mesh.restype = ctypes.c_void_p\n"
            "mesh = library.isomatch_mesh_file_mesh(file)\n"
            "pair = Pair(mesh, None, mesh, None, None, 0)\n"
            "assert library.isomatch_match(ctypes.byref(pair), None, None, ctypes.byref(result), ctypes.byref(error)) == 0\n"
            "_ctypes.dlclose(library._handle)\n"
            "time.sleep(0.2)\n"
        )
        run("/usr/bin/python3", "-c", program, self.library, self.folder / "A.off", env=self.loaded)

    def test_it_is_found_by_its_version(self):
        library = ctypes.CDLL(str(self.library))
        library.isomatch_version.restype = ctypes.c_char_p
        version = run(COMMAND_LINE, "--version").split()[-1]
        self.assertEqual(library.isomatch_version().decode(), version)


if __name__ == "__main__":
    unittest.main()
