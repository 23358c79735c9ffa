#!/usr/bin/env python3
"""Debian's packages: whose a file is, from which source, and under which licenses.

    docker/debian_packages.py ROOT FILE...

prints the names of the packages that the files are from, which lie below ROOT: / for
those of this machine, as dpkg knows them, or a folder of docker/cross/sysroot.
"""

from __future__ import annotations

import dataclasses
import os
import pathlib
import re
import subprocess
import sys
from collections.abc import Iterable

FIELDS = (
    "${Package}\t${Version}\t${source:Package}\t${source:Version}\t${Architecture}\n"
)
# Names of libraries. glibc's, which are as old as Debian 12's or newer, are never bundled:
# they have to be those of the loader that starts the program.
GLIBC = re.compile(
    r"(libc|libm|libmvec|libdl|libpthread|librt|libresolv|libutil|libanl|ld-linux.*)\.so\..*"
)
CXX = re.compile(r"(libgcc_s|libstdc\+\+)\.so\..*")


@dataclasses.dataclass(frozen=True, order=True)
class Package:
    name: str
    version: str
    source: str
    source_version: str
    architecture: str


def lines(*command: str) -> list[str]:
    """What it prints; dpkg -S may miss some of its arguments."""
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    return done.stdout.splitlines()


def both_names(path: str) -> set[str]:
    """A path, and its other name on a system where /lib is /usr/lib."""
    return {path, path[len("/usr") :] if path.startswith("/usr/lib") else "/usr" + path}


def files_read(build: pathlib.Path, targets: list[str], root: str) -> list[str]:
    """The system's files that ninja recorded as read by the build of the targets.

    Ends the program where there is no such record: then nobody knows the files.
    """
    inputs = lines("ninja", "-C", str(build), "-t", "inputs", *targets)
    objects = [name for name in inputs if name.endswith(".o")]
    if not objects:
        sys.exit(f"{build}: ninja knows no objects of {', '.join(targets)}, expected what it built")
    missing = [name for name in objects if not (build / name).exists()]
    if missing:
        sys.exit(f"{build}: {missing[0]}, of which {', '.join(targets)} is made, is not built")
    read = [line.strip() for line in lines("ninja", "-C", str(build), "-t", "deps", *objects)]
    usr = ("/usr/", f"{root}/usr/")
    return sorted({os.path.realpath(name) for name in read + inputs if name.startswith(usr)})


def license_names(text: str) -> list[str]:
    """The licenses that a copyright file in Debian's machine-readable format names."""
    if not text.startswith("Format:"):
        return []
    found = re.findall(r"^License:[ \t]*(\S.*)$", text, re.MULTILINE)
    return sorted({name.strip() for name in found})


class Packages:
    def __init__(self, root: str | os.PathLike[str] = "/") -> None:
        self._root = pathlib.Path(root).resolve()
        self._is_sysroot = (self._root / "packages.tsv").exists()
        if self._is_sysroot:
            rows = (self._root / "packages.tsv").read_text().splitlines()
        else:
            rows = lines("dpkg-query", "-W", "-f", FIELDS)
        self._packages = {row.partition("\t")[0]: Package(*row.split("\t")) for row in rows}

    def owners(self, paths: Iterable[str | os.PathLike[str]]) -> dict[str, Package]:
        """The package of each path that has one. Paths begin with the root."""
        wanted = {str(path): self._inside(str(path)) for path in paths}
        names = sorted(set().union(*(both_names(name) for name in wanted.values())))
        found = self._sysroot_owners(names) if self._is_sysroot else self._dpkg_owners(names)
        return {
            path: self._packages[found[name]]
            for path, inside in wanted.items()
            for name in both_names(inside)
            if name in found
        }

    def copyright(self, package: Package) -> str:
        """The text of its copyright file; empty if there is none."""
        path = self._root / "usr/share/doc" / package.name / "copyright"
        return path.read_text() if path.exists() else ""

    def _inside(self, path: str) -> str:
        root = str(self._root)
        return path[len(root) :] if root != "/" and path.startswith(root + "/") else path

    def _dpkg_owners(self, names: list[str]) -> dict[str, str]:
        found = {}
        for start in range(0, len(names), 1000):
            for line in lines("dpkg", "-S", *names[start : start + 1000]):
                packages, _, path = line.rpartition(": ")
                found[path] = packages.split(", ")[0].partition(":")[0]
        return found

    def _sysroot_owners(self, names: list[str]) -> dict[str, str]:
        wanted = set(names)
        rows = (row.split("\t") for row in (self._root / "files.tsv").open().read().splitlines())
        return {path: package for package, path in rows if path in wanted}


def compiled_in(
    build: pathlib.Path, targets: list[str], root: str | os.PathLike[str]
) -> dict[Package, str]:
    """The packages whose headers and static libraries the build read, and their licenses.

    Those of the compiler itself are this machine's.
    """
    top = str(pathlib.Path(root).resolve())
    read = files_read(build, targets, top)
    there = [path for path in read if top != "/" and path.startswith(top)]
    found = {}
    for paths, packages in ((there, Packages(top)), (set(read) - set(there), Packages("/"))):
        owners = packages.owners(paths).values() if paths else []
        found |= {package: packages.copyright(package) for package in owners}
    return found


def write_licenses(folder: pathlib.Path, texts: dict[Package, str]) -> None:
    """Writes each package's license there, and the texts that it names as every Debian's."""
    folder.mkdir(parents=True, exist_ok=True)
    common: set[str] = set()
    for package, text in texts.items():
        if text:
            (folder / f"{package.name}.txt").write_text(text)
            common |= set(re.findall(r"/usr/share/common-licenses/([\w.+-]*\w)", text))
    for name in common:
        path = pathlib.Path("/usr/share/common-licenses") / name
        if path.exists():
            (folder / "common-licenses").mkdir(exist_ok=True)
            (folder / "common-licenses" / name).write_bytes(path.read_bytes())


def write_table(path: pathlib.Path, rows: Iterable[tuple[str, Package]]) -> None:
    """A line for each: what it is about, and the package's fields, between tabs."""
    path.write_text(
        "".join("\t".join((name, *dataclasses.astuple(p))) + "\n" for name, p in sorted(rows))
    )


def read_table(path: pathlib.Path) -> list[tuple[str, Package]]:
    rows = (line.split("\t") for line in path.read_text().splitlines())
    return [(row[0], Package(*row[1:])) for row in rows]


def main() -> None:
    if len(sys.argv) < 3:
        sys.exit("usage: docker/debian_packages.py ROOT FILE...")
    owners = Packages(sys.argv[1]).owners(sys.argv[2:])
    print(*sorted({package.name for package in owners.values()}), sep="\n")


if __name__ == "__main__":
    main()
