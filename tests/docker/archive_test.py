"""docker/archive: what is in it, and that it runs from any folder by itself."""

import hashlib
import json
import os
import pathlib
import re
import shutil
import subprocess
import tarfile
import tempfile
import unittest

SOURCE = pathlib.Path(__file__).parents[2]
BUILD = os.environ["ISOMATCH_BUILD"]
COMMAND_LINE = os.environ["ISOMATCH_CLIENT_BINARY"]

# What any Linux with that glibc has.
GLIBC = re.compile(r"(lib(c|m|dl|pthread|rt|resolv)|ld-linux.*)\.so\.\d+")


def run(*command, status=0, **options):
    process = subprocess.run(
        list(map(str, command)), capture_output=True, text=True, timeout=300, **options
    )
    if process.returncode != status:
        raise AssertionError(f"{command}\n{process.stdout}{process.stderr}")
    return process.stdout + process.stderr


def make(folder):
    # As quick as it gets: xz -9 takes ten seconds.
    environment = {**os.environ, "SOURCE_DATE_EPOCH": "1700000000", "XZ_OPT": "-0"}
    run(SOURCE / "docker/archive", BUILD, folder, env=environment)
    [archive] = folder.glob("*.tar.xz")
    return archive


class ArchiveTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.archive = make(cls.folder / "first")
        with tarfile.open(cls.archive) as archive:
            cls.members = archive.getmembers()
            archive.extractall(cls.folder / "some where")
        [cls.root] = (cls.folder / "some where").iterdir()
        cls.machine = run("uname", "-m").strip()

    def programs(self):
        return [*self.root.glob("bin/*"), *self.root.glob("lib/*.so*")]

    def test_its_name_tells_version_and_machine(self):
        version = run(COMMAND_LINE, "--version").split()[-1]
        self.assertEqual(self.root.name, f"isomatch-{version}-linux-{self.machine}")
        self.assertEqual(self.archive.name, f"{self.root.name}.tar.xz")

    def test_the_same_programs_give_the_same_bytes(self):
        digests = {
            hashlib.sha256(path.read_bytes()).hexdigest()
            for path in (self.archive, make(self.folder / "second"))
        }
        self.assertEqual(len(digests), 1)
        for member in self.members:
            self.assertEqual((member.uid, member.gid, member.mtime), (0, 0, 1700000000), member.name)

    def test_it_has_all_that_it_needs(self):
        names = {path.name for path in self.root.glob("lib/*")}
        for program in self.programs():
            with self.subTest(program=program.name):
                needed = run("patchelf", "--print-needed", program).split()
                missing = [n for n in needed if n not in names and not GLIBC.fullmatch(n)]
                self.assertEqual(missing, [])
                way = "$ORIGIN/../lib" if program.parent.name == "bin" else "$ORIGIN"
                self.assertEqual(run("patchelf", "--print-rpath", program).strip(), way)
                glibc = re.findall(r"GLIBC_2\.(\d+)", run("objdump", "-T", program))
                self.assertLessEqual(max(map(int, glibc), default=0), 36)

    def test_it_matches_where_there_is_nothing_else(self):
        alone = {"PATH": "/none", "LD_LIBRARY_PATH": ""}
        command = self.root / "bin/isomatch"
        for pose in "AB":
            run(command, "sample", "--pose", pose, "--vertices", "1000",
                "-o", self.folder / f"{pose}.off", env=alone)  # fmt: skip
        pair = [self.folder / "A.off", self.folder / "B.off"]
        for name, program in (("there", command), ("here", COMMAND_LINE)):
            run(program, "match", *pair, "-o", self.folder / name, "--no-progress", env=alone)
        self.assertEqual((self.folder / "there").read_text(), (self.folder / "here").read_text())
        # All its libraries are its own.
        loaded = run(command, "--version", env={**alone, "LD_DEBUG": "libs"})
        found = re.findall(r"calling init: (.+)", loaded)
        self.assertGreater(len(found), 30)
        others = [path for path in found if not path.startswith(str(self.root))]
        self.assertEqual([p for p in others if not GLIBC.fullmatch(p.rpartition("/")[2])], [])
        self.assertIn("listen", run(self.root / "bin/isomatch-server", "--help", env=alone))

    def test_licenses_and_bill_of_materials_name_what_is_inside(self):
        bill = json.loads((self.root / "sbom.spdx.json").read_text())
        self.assertEqual(bill["spdxVersion"], "SPDX-2.3")
        packages = {package["name"]: package for package in bill["packages"]}
        # What is compiled in: the page's script, and headers.
        for name in ("three", "libeigen3-dev", "libtinygltf-dev"):
            self.assertIn(name, packages)
        links = {
            package["externalRefs"][0]["referenceLocator"]
            for package in packages.values()
            if "externalRefs" in package
        }
        self.assertTrue(any(link.startswith("pkg:deb/debian/libdraco7@") for link in links))
        licensed = {path.stem for path in self.root.glob("share/doc/isomatch/licenses/*.txt")}
        contained = {
            relation["relatedSpdxElement"]
            for relation in bill["relationships"]
            if relation["relationshipType"] == "CONTAINS"
        }
        debian = {name for name, p in packages.items() if p["SPDXID"] in contained}
        self.assertEqual(debian, licensed)
        digests = {
            file["fileName"]: file["checksums"][1]["checksumValue"] for file in bill["files"]
        }
        for path in self.root.rglob("*"):
            if path.is_file() and path.name != "sbom.spdx.json":
                name = f"./{path.relative_to(self.root)}"
                self.assertEqual(digests[name], hashlib.sha256(path.read_bytes()).hexdigest(), name)

    def test_a_library_that_is_nowhere_is_told(self):
        broken = self.folder / "broken"
        shutil.copy(self.root / "bin/isomatch", broken)
        run("patchelf", "--add-needed", "libnowhere.so.3", broken)
        said = run(SOURCE / "docker/bundle_libraries", self.folder / "lib", broken, status=1)
        self.assertIn("libnowhere.so.3, which broken needs, is in no lib/", said)


if __name__ == "__main__":
    unittest.main()
