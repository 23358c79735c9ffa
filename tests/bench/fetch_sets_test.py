"""scripts/bench fetch-sets, on a clone that holds as little as a set needs."""

import dataclasses
import pathlib
import subprocess
import tempfile
import unittest
from unittest import mock

import fetch_sets
import public_sets

TETRAHEDRON = b"OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
BASE = "Dataset/FAUST"
FILES = {
    f"{BASE}/test_pairs.txt": b"tr_reg_000\ttr_reg_001\ntr_reg_001\ttr_reg_060\n",
    f"{BASE}/vtx_5k/tr_reg_000.off": TETRAHEDRON,
    f"{BASE}/vtx_5k/tr_reg_001.off": TETRAHEDRON.replace(b"1 0 0", b"2 0 0"),
    f"{BASE}/vtx_5k/corres/tr_reg_000.vts": b"1\n2\n4\n",
    f"{BASE}/vtx_5k/corres/tr_reg_001.vts": b"3\n2\n1\n",
    f"{BASE}/vtx_5k/corres/tr_reg_001.sym.vts": b"4\n2\n1\n",
}


def git(folder, *arguments):
    author = ("-c", "user.name=a", "-c", "user.email=a@b")
    answer = subprocess.run(["git", *author, "-C", folder, *arguments],
                            capture_output=True, text=True, check=True)  # fmt: skip
    return answer.stdout.strip()


class FetchSetsTest(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.snapshots = pathlib.Path(scratch.name) / "snapshots"
        self.out = pathlib.Path(scratch.name) / "out"
        self.clone = self.snapshots / public_sets.BCICP.folder
        self.clone.mkdir(parents=True)

    def commit(self, files):
        """Makes the clone of these files, and their commit the one that is read."""
        for path, data in files.items():
            (self.clone / path).parent.mkdir(parents=True, exist_ok=True)
            (self.clone / path).write_bytes(data)
        git(self.clone, "init", "-q")
        git(self.clone, "add", ".")
        git(self.clone, "commit", "-q", "-m", "files")
        commit = git(self.clone, "rev-parse", "HEAD")
        for name in ("faust5k", "tosca5k"):
            known = public_sets.SETS[name]
            here = dataclasses.replace(known.repository, commit=commit)
            changed = {name: dataclasses.replace(known, repository=here)}
            patch = mock.patch.dict(public_sets.SETS, changed)
            patch.start()
            self.addCleanup(patch.stop)

    def run_program(self, *arguments):
        """Returns the exit status and what was said on stderr."""
        words = ["fetch-sets", str(self.snapshots), str(self.out), *arguments]
        said = []
        with mock.patch("sys.argv", words), mock.patch("builtins.print") as fake:
            status = fetch_sets.main()
        for call in fake.call_args_list:
            if call.kwargs.get("file"):
                said.append(call.kwargs.get("sep", " ").join(call.args))
        return status, "\n".join(said)

    def read(self, name):
        return (self.out / name).read_bytes()

    def test_pairs_meshes_and_truth_are_those_of_the_repository(self):
        self.commit(FILES)
        self.assertEqual(self.run_program("faust5k"), (0, ""))
        self.assertEqual(self.read("faust5k/pairs.txt"), b"tr_reg_000 tr_reg_001\n")
        self.assertEqual(self.read("faust5k/tr_reg_000.off"), TETRAHEDRON)
        self.assertEqual(
            self.read("faust5k/gt_tr_reg_000__tr_reg_001.txt"), b"0 2 3\n1 1 1\n3 0 0\n"
        )

    def test_a_place_moves_y_alone_and_always_in_the_same_way(self):
        self.commit(FILES)
        name = "faust5k/tr_reg_001_both_for_tr_reg_000.off"
        self.assertEqual(self.run_program("faust5k", "--place", "both"), (0, ""))
        first = self.read(name)
        self.assertEqual(self.run_program("faust5k", "--place", "both"), (0, ""))
        self.assertEqual(self.read(name), first)
        self.assertEqual(self.read("faust5k/tr_reg_000.off"), TETRAHEDRON)
        corners = [line.split() for line in first.decode().splitlines()[2:6]]
        lengths = [sum(float(word) ** 2 for word in corner) ** 0.5 for corner in corners]
        self.assertAlmostEqual(lengths[1], 2 * lengths[2], places=6)  # still alike
        self.assertNotAlmostEqual(lengths[2], 1, places=3)  # scaled
        self.assertNotAlmostEqual(float(corners[1][0]), lengths[1], places=3)  # turned

    def test_a_missing_clone_is_named_with_its_command_and_other_sets_are_made(self):
        self.commit(FILES)
        status, said = self.run_program("aniso", "faust5k", "smal")
        self.assertEqual(status, 1)
        self.assertIn("aniso is not made: there is no clone in", said)
        folder = self.snapshots / "nicolasdonati+DUO-FM"
        command = f"git clone https://github.com/nicolasdonati/DUO-FM {folder}"
        self.assertEqual(said.count(command), 1)
        self.assertTrue((self.out / "faust5k/pairs.txt").exists())

    def test_a_clone_without_the_commit_is_refused(self):
        git(self.clone, "init", "-q")
        status, said = self.run_program("faust5k")
        self.assertEqual(status, 1)
        self.assertIn(f"has no commit {public_sets.BCICP.commit}", said)
        self.assertIn(f"fetch origin {public_sets.BCICP.commit}", said)

    def test_errors_name_the_file(self):
        path = f"{BASE}/vtx_5k/corres/tr_reg_001.vts"
        self.commit({**FILES, path: b"1\nx\n"})
        self.assertIn(f"{path}: expected rows of 1 numbers", self.run_program("faust5k")[1])
        self.assertFalse((self.out / "faust5k/pairs.txt").exists())
        path = f"{BASE}/vtx_5k/tr_reg_001.off"
        self.commit({path: b"OFF\n4 4\n"})
        self.assertIn(f"{path}: expected an OFF file", self.run_program("faust5k")[1])
        git(self.clone, "rm", "-q", path)
        self.commit({})
        self.assertIn(f"{path}: there is no such file", self.run_program("faust5k")[1])
        self.assertIn("Dataset/TOSCA_Isometric/test_pairs.txt: there is no such file",
                      self.run_program("tosca5k")[1])  # fmt: skip

    def test_a_set_that_is_not_there_is_refused(self):
        with self.assertRaises(SystemExit), mock.patch("sys.stderr"):
            self.run_program("none")


if __name__ == "__main__":
    unittest.main()
