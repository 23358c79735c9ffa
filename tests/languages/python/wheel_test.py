"""The wheel: what is in it, and that each Python of this machine matches with it alone."""

import hashlib
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
import zipfile

import support

BUILD_WHEEL = pathlib.Path(os.environ["ISOMATCH_BUILD_WHEEL"])
LIBRARY = os.environ["ISOMATCH_LIBRARY"]

# As one who has just installed it would.
MATCH = """
import sys, isomatch
result = isomatch.match(sys.argv[1], sys.argv[2])
assert "site" in isomatch._library.load()._name, isomatch._library.load()._name
assert "</html>" in result.page()
print("\\n".join(map(str, result.y_from_x)))
"""


def run(*command, **options):
    process = subprocess.run(
        list(map(str, command)), capture_output=True, text=True, timeout=120, **options
    )
    if process.returncode != 0:
        raise AssertionError(f"{command}\n{process.stdout}{process.stderr}")
    return process.stdout


def build(folder):
    run(sys.executable, BUILD_WHEEL, LIBRARY, folder)
    [wheel] = folder.glob("*.whl")
    return wheel


class WheelTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.wheel = build(cls.folder / "first")

    def test_any_python_of_a_debian_12_or_later_takes_it(self):
        self.assertRegex(
            self.wheel.name, r"^isomatch-[\d.]+-py3-none-manylinux_2_36_x86_64\.whl$"
        )
        # It belongs where a system keeps what is of one kind of machine.
        with zipfile.ZipFile(self.wheel) as wheel:
            [about] = [name for name in wheel.namelist() if name.endswith(".dist-info/WHEEL")]
            said = wheel.read(about).decode()
        self.assertIn("Root-Is-Purelib: false\nTag: py3-none-manylinux_2_36_x86_64\n", said)

    def test_it_has_the_manual(self):
        with zipfile.ZipFile(self.wheel) as wheel:
            [about] = [name for name in wheel.namelist() if name.endswith(".dist-info/METADATA")]
            said = wheel.read(about).decode()
        self.assertIn("Description-Content-Type: text/markdown\n", said)
        for part in ("isomatch.match(", "## Python\n", "## Files\n", "server=", "glTF"):
            self.assertIn(part, said)
        self.assertNotIn("](", said, "there is nothing to link to")

    def test_the_same_library_gives_the_same_bytes(self):
        digests = {
            hashlib.sha256(wheel.read_bytes()).hexdigest()
            for wheel in (self.wheel, build(self.folder / "second"))
        }
        self.assertEqual(len(digests), 1)

    def test_it_has_all_that_its_libraries_need(self):
        unpacked = self.folder / "unpacked"
        zipfile.ZipFile(self.wheel).extractall(unpacked)
        libraries = list(unpacked.glob("isomatch/lib/*.so*"))
        self.assertGreater(len(libraries), 5)
        names = {library.name for library in libraries}
        system = re.compile(r"lib(c|m|gcc_s|stdc\+\+)\.so\.\d+|ld-linux.*")
        for library in libraries:
            with self.subTest(library=library.name):
                needed = set(run("patchelf", "--print-needed", library).split())
                self.assertEqual(
                    {name for name in needed - names if not system.fullmatch(name)}, set()
                )
                self.assertEqual(run("patchelf", "--print-rpath", library).strip(), "$ORIGIN")
                glibc = re.findall(r"GLIBC_2\.(\d+)", run("objdump", "-T", library))
                self.assertLessEqual(max(map(int, glibc), default=0), 36)
        # Another wheel's libdraco is not taken for this one's.
        shown = [name for name in names if name.startswith("libdraco")]
        self.assertRegex(" ".join(shown), r"^libdraco-[0-9a-f]{8}\.so\.\d+$")
        licensed = {path.name for path in unpacked.glob("isomatch/lib/licenses/*.txt")}
        self.assertTrue({"libdraco7.txt", "libtbb12.txt"} <= licensed, licensed)
        # Debian's texts only name these.
        self.assertTrue(list(unpacked.glob("isomatch/lib/licenses/common-licenses/*")))

    def test_it_has_the_licenses_of_what_was_compiled_in(self):
        with zipfile.ZipFile(self.wheel) as wheel:
            names = set(wheel.namelist())
            table = wheel.read("isomatch/lib/compiled.tsv").decode()
            page = wheel.read("isomatch/lib/licenses/isomatch.txt").decode()
        packages = {line.partition("\t")[0] for line in table.splitlines()}
        self.assertLess(
            {"libeigen3-dev", "libspectra-dev", "libtinygltf-dev", "nlohmann-json3-dev"}, packages
        )
        self.assertFalse({"libgtest-dev", "libcli11-dev"} & packages, "of other programs")
        texts = {f"isomatch/lib/licenses/{package}.txt" for package in packages}
        self.assertEqual(texts - names, set())
        self.assertIn("isomatch/lib/licenses/common-licenses/MPL-2.0", names)  # Eigen's
        self.assertIn("three.js authors", page)

    def test_a_library_from_elsewhere_is_refused(self):
        elsewhere = self.folder / "libisomatch.so.0"
        shutil.copy(LIBRARY, elsewhere)
        with self.assertRaisesRegex(AssertionError, "expected a library where it was built"):
            run(sys.executable, BUILD_WHEEL, elsewhere, self.folder / "none")
        self.assertFalse((self.folder / "none").exists())

    def test_each_python_of_this_machine_matches_with_it_alone(self):
        x, y = support.pair()
        pythons = {**support.other_pythons(), "this one": pathlib.Path(sys.executable)}
        clean = {
            name: value
            for name, value in os.environ.items()
            if not name.startswith(("ISOMATCH_", "PYTHON"))
        }
        for name, python in pythons.items():
            with self.subTest(name=name):
                site = self.folder / f"site-{name}"
                run(python, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps",
                    "--disable-pip-version-check", "--root-user-action=ignore",
                    "--target", site, self.wheel, env=clean)  # fmt: skip
                mapped = run(python, "-c", MATCH, x, y, env={**clean, "PYTHONPATH": str(site)})
                self.assertEqual(mapped.encode(), support.map_of_command_line(x, y))
        print("matched by", ", ".join(sorted(pythons)))


if __name__ == "__main__":
    unittest.main()
