"""docker/archive: it runs from any folder by itself; docker/check_archive finds faults."""

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

CHECK = SOURCE / "docker/check_archive"

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


def replace(path, content):
    mode = path.stat().st_mode
    path.unlink()
    path.write_bytes(content)
    path.chmod(mode)


def patch(name, *arguments):
    """A fault that patchelf makes."""

    def plant(root):
        replace(root / name, (root / name).read_bytes())
        run("patchelf", *arguments, root / name)

    return plant


def change_mode(root, name, mode):
    replace(root / name, (root / name).read_bytes())
    (root / name).chmod(mode)


def need_newer_glibc(root):
    path = root / "lib/libtbb.so.12"
    newest = max(re.findall(rb"GLIBC_2\.\d\d", path.read_bytes()))
    replace(path, path.read_bytes().replace(newest, b"GLIBC_2.39"))


def move_runtime(root):
    for path in list((root / "lib/c++").iterdir()):
        path.rename(root / "lib" / path.name)
        patch(f"lib/{path.name}", "--force-rpath", "--set-rpath", "$ORIGIN")(root)


# How each is made, and what is said of it. They do not touch each other's files.
FAULTS = {
    "a library is missing": (
        lambda root: (root / "lib/libdraco.so.7").unlink(),
        "bin/isomatch: needs libdraco.so.7, which bin/isomatch does not find",
    ),
    "an absolute path": (
        patch("lib/libfmt.so.9", "--force-rpath", "--set-rpath", "/usr/lib:$ORIGIN"),
        "lib/libfmt.so.9: RPATH /usr/lib leads out of the archive",
    ),
    "a path that leads out": (
        patch("lib/libpng16.so.16", "--force-rpath", "--set-rpath", "$ORIGIN/../../lib"),
        r"lib/libpng16.so.16: RPATH \$ORIGIN/../../lib leads out of the archive",
    ),
    "a path after LD_LIBRARY_PATH": (
        patch("lib/libz.so.1", "--set-rpath", "$ORIGIN"),
        r"lib/libz.so.1: RUNPATH \$ORIGIN, which LD_LIBRARY_PATH goes before",
    ),
    "a newer glibc": (
        need_newer_glibc,
        "lib/libtbb.so.12: needs glibc 2.39, expected 2.36 at most",
    ),
    "the runtime of C++ among libraries": (
        move_runtime,
        r"lib/libstdc\+\+.so.6: expected in lib/c\+\+",
    ),
    "a library that others load finds nothing": (
        patch("lib/libisomatch.so.0", "--remove-rpath"),
        r"lib/libisomatch.so.0: needs \S+, which lib/libisomatch.so.0 does not find",
    ),
    "another loader": (
        patch("bin/isomatch-server", "--set-interpreter", "/opt/ld.so"),
        "bin/isomatch-server: started by /opt/ld.so, expected /lib",
    ),
    "a library of another name": (
        patch("lib/libgmp.so.10", "--set-soname", "libgmp.so.11"),
        "lib/libgmp.so.10: calls itself libgmp.so.11, expected its file's name",
    ),
    "a library that is none": (
        lambda root: replace(root / "lib/libffi.so.8", b""),
        "lib/libffi.so.8: neither a program nor a library",
    ),
    "a program that is not executable": (
        lambda root: change_mode(root, "bin/isomatch", 0o644),
        "bin/isomatch: mode 644, expected 755",
    ),
    "another file": (
        lambda root: replace(root / "CHANGELOG.md", b"Another."),
        "CHANGELOG.md: its SHA-256 is not that of the bill of materials",
    ),
    "a file too many": (
        lambda root: (root / "bin/more").write_text("#!/bin/sh"),
        "bin/more: in the archive alone",
    ),
    "a file that others may write": (
        lambda root: change_mode(root, "LICENSE", 0o666),
        "LICENSE: mode 666, expected 644 or 755",
    ),
    "a license is missing": (
        lambda root: (root / "share/doc/isomatch/licenses/libre2-9.txt").unlink(),
        "libre2-9: no license",
    ),
    "a license of headers is missing": (
        lambda root: (root / "share/doc/isomatch/licenses/libeigen3-dev.txt").unlink(),
        "libeigen3-dev: no license",
    ),
    "the page's licenses are missing": (
        lambda root: (root / "share/doc/isomatch/licenses/isomatch.txt").unlink(),
        "licenses/isomatch.txt: missing",
    ),
    "a link is missing": (
        lambda root: (root / "lib/libisomatch.so").unlink(),
        "lib/libisomatch.so: missing",
    ),
    "a license's text is missing": (
        lambda root: (root / "share/doc/isomatch/licenses/common-licenses/GPL-2").unlink(),
        "names the license GPL-2, which is not there",
    ),
    "a link to elsewhere": (
        lambda root: (root / "lib/libelse.so").symlink_to("/usr/lib/libelse.so"),
        "lib/libelse.so: leads to /usr/lib/libelse.so, which is not in the archive",
    ),
    "a newer file": (lambda root: None, "time 1700000001, expected 1700000000"),
    "another owner": (lambda root: None, "owner 1000:0, expected 0:0"),
}


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

    def test_all_holds_that_is_promised_of_archives(self):
        # With --without too in scripts/package: this build's asserts name source files.
        said = run(CHECK, self.archive, "--epoch", 1700000000)
        self.assertIn("all holds", said)

    def test_planted_faults_are_found(self):
        work = self.folder / "planted"
        work.mkdir()
        root = work / self.root.name
        # As links: a fault replaces files, and changes none in place.
        shutil.copytree(self.root, root, symlinks=True, copy_function=os.link)
        for plant, _ in FAULTS.values():
            plant(root)
        archive = work / f"{root.name}.tar"
        run("tar", "--create", "--file", archive, "--directory", work, "--sort=name",
            "--format=gnu", "--mtime=@1700000001", "--owner=1000", "--group=0",
            "--numeric-owner", root.name)  # fmt: skip
        faults = run(CHECK, archive, "--epoch", 1700000000, status=1)
        for name, (_, said) in FAULTS.items():
            with self.subTest(fault=name):
                self.assertRegex(faults, said)

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
        # All its libraries are its own, though others have the same names.
        others = self.folder / "others"
        others.mkdir()
        for library in self.root.glob("lib/**/*.so*"):
            (others / library.name).write_text("This is no library.")
        environment = {**alone, "LD_DEBUG": "libs", "LD_LIBRARY_PATH": str(others)}
        loaded = run(command, "--version", env=environment)
        found = re.findall(r"calling init: (.+)", loaded)
        self.assertGreater(len(found), 30)
        others = [path for path in found if not path.startswith(str(self.root))]
        self.assertEqual([p for p in others if not GLIBC.fullmatch(p.rpartition("/")[2])], [])
        server = [self.root / "bin/isomatch-server", "--config", self.root / "etc/server.toml"]
        self.assertIn("listen", run(*server, "--print-config", env=alone))

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
        self.assertLess(debian, licensed)
        # Those whose headers became part of the programs.
        self.assertLess({"libeigen3-dev", "libcli11-dev", "libnanoflann-dev"}, licensed)
        for name in ("libgmp10", "libeigen3-dev", "libstdc++6"):
            self.assertRegex(packages[name]["sourceInfo"], r"source package \S+ \d")
            self.assertRegex(packages[name]["licenseDeclared"], r"^LicenseRef-Debian-")
        texts = {text["licenseId"] for text in bill["hasExtractedLicensingInfos"]}
        declared = {package["licenseDeclared"] for package in packages.values()}
        self.assertEqual({name for name in declared if "Ref" in name}, texts)

    def test_a_library_for_others_leaves_them_their_runtime_of_cxx(self):
        library = self.root / "lib/libisomatch.so.0"
        search = ["libstdc++.so.6", "libgcc_s.so.1"]
        needed = run("patchelf", "--print-needed", library).split()
        self.assertLess(set(search), set(needed))
        script = "import ctypes, sys; ctypes.CDLL(sys.argv[1]).isomatch_version; print(*open('/proc/self/maps'))"
        maps = run("/usr/bin/python3", "-c", script, library)
        for name in search:
            path = re.findall(rf"\S+/{re.escape(name)}[.\d]*", maps)
            self.assertFalse(any(str(self.root) in found for found in path), path)

    def test_a_library_that_is_nowhere_is_told(self):
        broken = self.folder / "broken"
        shutil.copy(self.root / "bin/isomatch", broken)
        run("patchelf", "--add-needed", "libnowhere.so.3", broken)
        said = run(SOURCE / "docker/bundle_libraries", self.folder / "lib", broken, status=1)
        self.assertIn("libnowhere.so.3, which broken needs, is in no lib/", said)

    def test_whose_headers_were_compiled_in_is_never_guessed(self):
        empty = self.folder / "empty"
        empty.mkdir()
        for build, target in ((BUILD, "bin/nothing"), (empty, "bin/isomatch")):
            said = run(SOURCE / "docker/compiled_in", build, self.folder / "none", target, status=1)
            self.assertIn(f"{build}: ninja knows no objects of {target}", said)
        self.assertFalse((self.folder / "none").exists())


if __name__ == "__main__":
    unittest.main()
