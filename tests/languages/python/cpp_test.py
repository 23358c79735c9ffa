"""The C++ library as its users get it: installed, found by CMake's find_package, and
used by the pages of client/cpp/examples and by the program in client/README.md."""

import os
import pathlib
import re
import shutil
import subprocess
import unittest

import numpy as np
import readme_test
import support

import isomatch

BUILD = os.environ["ISOMATCH_BUILD"]
EXAMPLES = os.environ["ISOMATCH_CPP_EXAMPLES"]
CMAKE = os.environ["ISOMATCH_CMAKE"]
#: Emptied before the tests, left after them.
FOLDER = pathlib.Path(os.environ["ISOMATCH_CPP_FOLDER"])
PREFIX = FOLDER / "prefix"


def run(*command: str | os.PathLike[str]) -> str:
    """Returns what it prints; a failure shows that, too."""
    process = subprocess.run(
        list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    if process.returncode != 0:
        raise AssertionError(f"{' '.join(map(str, command))}\n{process.stdout}")
    return process.stdout


def build(source: os.PathLike[str], out: pathlib.Path) -> None:
    """As a user would: for the compiler's own instruction set, whatever ours is."""
    run(
        CMAKE, "-S", source, "-B", out, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=RelWithDebInfo",
        f"-DCMAKE_CXX_COMPILER={os.environ['ISOMATCH_CXX']}", f"-DCMAKE_PREFIX_PATH={PREFIX}",
    )  # fmt: skip
    run(CMAKE, "--build", out)


class CppTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(FOLDER, ignore_errors=True)
        for component in ("library", "sdk", "client", "server"):
            run(CMAKE, "--install", BUILD, "--component", component, "--prefix", PREFIX)
        build(EXAMPLES, FOLDER / "examples")
        cls.server = cls.enterClassContext(support.Server("--ephemeral", "--workers=1"))

    def start(self, program, *arguments):
        return subprocess.Popen(
            [program, *map(str, arguments)],
            env={**os.environ, "ISOMATCH_SERVER": self.server.address},
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    def run_example(self, name, *arguments, status=0):
        """Returns what it prints and says, after the status was checked."""
        process = self.start(FOLDER / "examples" / name, *arguments)
        printed, said = process.communicate(timeout=120)
        self.assertEqual(process.returncode, status, said)
        return printed, said

    def test_the_unit_starts_what_is_installed(self):
        unit = (PREFIX / "lib/systemd/system/isomatch-server.service").read_text()
        command = re.search("^ExecStart=(.*)$", unit, re.MULTILINE).group(1)
        server, config = PREFIX / "bin/isomatch-server", PREFIX / "etc/isomatch/server.toml"
        self.assertEqual(command, f"{server} --config {config}")
        self.assertNotIn("/usr/local", unit)
        self.assertTrue(config.is_file())
        self.assertIn("isomatch-server", run(server, "--version"))

    def test_headers_are_in_one_folder_and_complete(self):
        include = PREFIX / "include"
        names = sorted(path.name for path in include.iterdir())
        self.assertEqual(names, ["isomatch", "isomatch.h"])
        headers = list(include.rglob("*.h"))
        self.assertGreater(len(headers), 10)
        for header in headers:
            for name in re.findall(r'^#include "([^"]+)"', header.read_text(), re.MULTILINE):
                with self.subTest(header=header, include=name):
                    places = (include / name, include / "isomatch" / name)
                    self.assertTrue(name.startswith("absl/") or any(p.exists() for p in places))

    def test_match_two_files(self):
        output = FOLDER / "two_files.txt"
        printed, said = self.run_example("match_two_files", *support.pair(), output)
        self.assertIn("1000 of 1000 vertices matched", printed)
        self.assertIn("100 %", said)
        self.assertEqual(output.read_bytes(), support.map_of_command_line(*support.pair()))
        missing = FOLDER / "missing.off"
        _, said = self.run_example("match_two_files", missing, missing, output, status=1)
        self.assertIn(str(missing), said)

    def test_landmarks(self):
        pairs = FOLDER / "pairs.txt"
        true = support.truth()
        pairs.write_text(f"7 {true[7]}\n300 {true[300]}\n500 {true[20]}\n")
        printed, _ = self.run_example("landmarks", *support.pair(), pairs)
        self.assertIn(f"7 -> {true[7]}: kept", printed)
        self.assertIn(f"500 -> {true[20]}: contradicted, the map says", printed)
        pairs.write_text("7 900\n")
        _, said = self.run_example("landmarks", *support.pair(), pairs, status=1)
        self.assertIn("line 1", said)

    def test_template_to_many(self):
        folder = FOLDER / "many"
        folder.mkdir()
        x, y = support.pair()
        broken = FOLDER / "broken.off"
        broken.write_text("OFF\n3 1 0\n")
        printed, said = self.run_example("template_to_many", x, folder, y, broken, x, status=1)
        self.assertEqual((folder / f"{y.stem}.txt").read_bytes(), support.map_of_command_line(x, y))
        # To itself: nearly all vertices stay.
        own = [int(line) for line in (folder / f"{x.stem}.txt").read_text().split()]
        self.assertGreater(sum(i == vertex for i, vertex in enumerate(own)), 0.95 * len(own))
        self.assertIn(f"{y.stem:20} distortion 0.0", printed)
        self.assertIn("broken: ", said)
        self.assertEqual(len(list(folder.iterdir())), 2)

    def test_transfer_texture(self):
        x, y = support.pair()
        output = FOLDER / "striped.off"
        printed, _ = self.run_example("transfer_texture", x, y, output)
        self.assertIn(f"{output}: 1000 vertices with the colors of {y}", printed)
        magic, counts, *lines = output.read_text().splitlines()
        self.assertEqual((magic, counts.split()[0]), ("COFF", "1000"))
        # As the vertices of Y are striped that the truth names, but at the seams.
        vertices, _ = isomatch.read_mesh(y)
        low, span = vertices.min(axis=0), np.ptp(vertices, axis=0)
        along = ((vertices - low) / span)[:, span.argmax()]
        wanted = (12 * along[support.truth()]).astype(int) % 3
        colors = [line.split()[3:6] for line in lines[:1000]]
        striped = [["230 80 60", "250 220 120", "60 110 180"].index(" ".join(c)) for c in colors]
        self.assertGreater(np.mean(wanted == striped), 0.85)

    def test_watch_from_another_process(self):
        name = "watch_from_another_process"
        _, said = self.run_example(name, "fetch", "nowhere.txt", status=1)
        self.assertIn("nothing was started", said)
        with isomatch.Client(self.server.address) as client:
            # The server's only worker is busy until the watch has begun.
            ahead = client.submit(*support.slow_pair(), **support.SLOW)
            support.wait_for_state(ahead, isomatch.JobState.RUNNING, 30)
            job, _ = self.run_example(name, "start", *support.pair())
            watch = self.start(FOLDER / "examples" / name, "watch")
            first = watch.stdout.readline()
            ahead.cancel()
        rest, said = watch.communicate(timeout=120)
        self.assertEqual(watch.returncode, 0, said)
        self.assertTrue(first.startswith(f"{job.strip()}  STATE_QUEUED  0 %"), first)
        self.assertTrue(
            rest.splitlines()[-1].startswith(f"{job.strip()}  STATE_SUCCEEDED  100 %"), rest
        )
        output = FOLDER / "watched.txt"
        printed, _ = self.run_example(name, "fetch", output)
        self.assertEqual(printed, f"{job.strip()}: 1000 vertices\n")
        self.assertEqual(output.read_bytes(), support.map_of_command_line(*support.pair()))

    def test_the_program_of_the_readme(self):
        source = FOLDER / "app"
        source.mkdir()
        [lists] = support.blocks(readme_test.MANUAL, "C++", "cmake")
        [program] = support.blocks(readme_test.MANUAL, "C++", "cpp")
        (source / "CMakeLists.txt").write_text(lists)
        program = readme_test.replaced(program, "127.0.0.1:7443", self.server.address)
        (source / "app.cc").write_text(program)
        build(source, source / "build")
        for path, name in zip(support.pair(), ("cat.off", "dog.off"), strict=True):
            (source / name).write_bytes(path.read_bytes())
        printed = subprocess.run(
            [source / "build" / "app"], cwd=source, check=True, capture_output=True, timeout=120
        ).stdout
        self.assertEqual(printed, support.map_of_command_line(*support.pair()))

    def test_the_command_comes_with_its_manual_and_completions(self):
        program = PREFIX / "bin" / "isomatch"
        share = PREFIX / "share"
        page = share / "man" / "man1" / "isomatch.1"
        self.assertEqual(page.read_text(), run(program, "man"))
        for shell, path in (
            ("bash", "bash-completion/completions/isomatch"),
            ("zsh", "zsh/vendor-completions/_isomatch"),
            ("fish", "fish/vendor_completions.d/isomatch.fish"),
        ):
            with self.subTest(shell=shell):
                self.assertEqual((share / path).read_text(), run(program, "completion", shell))


if __name__ == "__main__":
    unittest.main()
