"""isomatch.match in this process: what only there can happen."""

import json
import os
import pathlib
import pickle
import subprocess
import sys
import threading
import time
import types
import unittest
from unittest import mock

import numpy as np
import support

import isomatch
from isomatch import _library, _progress

ALONE = """
import sys
for name in {missing!r}:
    sys.modules[name] = None  # as if it were not installed
import isomatch
"""


def run_python(script, *, missing=(), status=0, **environment):
    """Returns what a new process prints."""
    process = subprocess.run(
        [sys.executable, "-c", ALONE.format(missing=tuple(missing)) + script],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=120,
    )
    if process.returncode != status:
        raise AssertionError(process.stdout + process.stderr)
    return process.stdout


def resident_bytes():
    pages = int(pathlib.Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


class WithoutTest(unittest.TestCase):
    """Where something is not installed."""

    def test_without_numpy_lists_come_and_go(self):
        x, y = support.pair()
        found = run_python(
            f"""
import json
vertices, faces = isomatch.read_mesh({str(y)!r})
result = isomatch.match({str(x)!r}, (vertices, [tuple(face) for face in faces]),
                        landmarks=[(7, {support.truth()[7]})])
assert type(vertices) is type(vertices[0]) is list
assert all(result.matched) and len(result.precise.weights[0]) == 3
assert result.matched_y == [True] * 900
assert len(result.functional_map(4).fmap_x_from_y[3]) == 4
heights = result.transfer([row[2] for row in vertices]), result.transfer(vertices)
assert all(abs(h - row[2]) < 1e-12 for h, row in zip(*heights))
assert max(abs(h - vertices[y][2]) for h, y in zip(heights[0], result.y_from_x)) > 0
steps = [y / 7 for y in range(900)]
assert result.transfer([0, *steps[1:]]) == result.transfer(steps)  # numbers, not labels
carried = result.transfer(["vertex %d" % y for y in range(900)])
assert carried[5] == "vertex %d" % result.y_from_x[5]
assert "</html>" in result.page()
print(json.dumps([result.y_from_x, result.confidence, result.info.landmarks[0].kept, heights[0]]))
""",
            missing=["numpy"],
        )
        mapped, confidence, kept, heights = json.loads(found)
        result = isomatch.match(x, y, landmarks=[(7, support.truth()[7])])
        self.assertEqual(mapped, result.y_from_x.tolist())
        np.testing.assert_array_equal(np.float32(confidence), result.confidence)
        self.assertTrue(kept)
        expected = result.transfer(isomatch.read_mesh(y)[0][:, 2])
        np.testing.assert_allclose(heights, expected, atol=1e-12)

    def test_without_numpy_what_is_wrong_is_named_as_with_it(self):
        square = [[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 1, 2]]
        wrong = {
            "x.vertices": (7, square[1]),
            "x.vertices[1]": ([[0, 0, 0], [1, 0], [1, 1, 0]], square[1]),
            "x.vertices[2]": ([[0, 0, 0], [1, 0, 0], [1, 1, 1e39]], square[1]),
            "x.faces[0]": (square[0], [[0, 1, 3]]),
            "x.faces": (square[0], []),
        }
        for field, mesh in wrong.items():
            with self.subTest(field=field):
                script = f"""
try:
    isomatch.match({mesh!r}, {square!r})
except isomatch.InvalidInput as error:
    print(error.field)
"""
                self.assertEqual(run_python(script, missing=["numpy"]).strip(), field)
                with self.assertRaises(isomatch.InvalidInput) as caught:
                    isomatch.match(mesh, square)
                # numpy sees rows of two lengths as a whole.
                self.assertTrue(field.startswith(caught.exception.field))

    def test_without_grpc_only_servers_are_missed(self):
        x, y = support.pair()
        script = f"""
print(isomatch.match({str(x)!r}, {str(y)!r}).verdict.level)
for call in (lambda: isomatch.Client, lambda: isomatch.match({str(x)!r}, {str(y)!r}, server="a:1")):
    try:
        call()
    except isomatch.ServerSupportMissing as error:
        print(error)
"""
        level, *errors = run_python(script, missing=["grpc"]).splitlines()
        self.assertEqual(level, "good")
        self.assertEqual(len(errors), 2)
        for error in errors:
            self.assertIn("pip install 'isomatch[server]'", error)

    def test_nothing_of_grpc_is_imported_unasked(self):
        script = "print('grpc' in sys.modules, 'google.protobuf' in sys.modules)"
        self.assertEqual(run_python(script).split(), ["False", "False"])

    def test_without_the_library_a_server_still_serves_arrays(self):
        x, y = support.pair()
        with support.Server("--ephemeral") as server:
            script = f"""
import numpy as np
for call in (lambda: isomatch.match({str(x)!r}, {str(y)!r}), lambda: isomatch.read_mesh({str(x)!r})):
    try:
        call()
    except isomatch.LibraryNotFound as error:
        print(error)
meshes = np.load({str(self._arrays(x, y))!r})
result = isomatch.match((meshes["vx"], meshes["fx"]), (meshes["vy"], meshes["fy"]),
                        server={server.address!r})
print(result.verdict.level)
"""
            said = run_python(script, ISOMATCH_LIBRARY="/none/libisomatch.so.0").splitlines()
        self.assertEqual(said[-1], "good")
        self.assertEqual(len(said), 3)
        for line in said[:2]:
            self.assertIn("/none/libisomatch.so.0: ", line)
            self.assertIn("expected the wheel of Isomatch", line)

    @staticmethod
    def _arrays(x, y):
        path = support.folder() / "arrays.npz"
        (vx, fx), (vy, fy) = isomatch.read_mesh(x), isomatch.read_mesh(y)
        np.savez(path, vx=vx, fx=fx, vy=vy, fy=fy)
        return path


class InterruptTest(unittest.TestCase):
    def test_ctrl_c_ends_it_soon_and_the_next_match_is_as_ever(self):
        x, y = support.slow_pair()
        script = f"""
import isomatch, os, signal, threading, time
def interrupt():
    time.sleep(0.5)
    global sent
    sent = time.monotonic()
    os.kill(os.getpid(), signal.SIGINT)
threading.Thread(target=interrupt).start()
try:
    isomatch.match({str(x)!r}, {str(y)!r}, profile="paper")
    print("not interrupted")
except KeyboardInterrupt:
    print(time.monotonic() - sent)
print(isomatch.match({str(x)!r}, {str(y)!r}).verdict.level)
"""
        seconds, level = run_python(script).splitlines()
        self.assertLess(float(seconds), 2)
        self.assertEqual(level, "good")

    def test_an_impatient_ctrl_c_harms_nothing(self):
        """Several of them, while it starts and while it ends."""
        x, y = support.slow_pair()
        script = f"""
import isomatch, os, random, signal, threading, time
dice = random.Random(1)
meshes = isomatch.read_mesh({str(x)!r}), isomatch.read_mesh({str(y)!r})
def interrupt(first):
    for pause in (first, 0.01, 0.02, 0.05):
        time.sleep(pause)
        os.kill(os.getpid(), signal.SIGINT)
    done.set()
caught = 0
for _ in range(12):
    done = threading.Event()
    thread = threading.Thread(target=interrupt, args=(dice.uniform(0, 0.05),))
    try:
        thread.start()
        isomatch.match(*meshes, profile="paper")
    except KeyboardInterrupt:
        caught += 1
    while not done.is_set():
        try:
            done.wait()
        except KeyboardInterrupt:
            pass
print(caught, isomatch.match(*meshes).verdict.level, threading.active_count() <= 2)
"""
        self.assertEqual(run_python(script, MALLOC_PERTURB_="165").split(), ["12", "good", "True"])

    def test_python_ends_while_another_thread_matches(self):
        x, y = support.slow_pair()
        script = f"""
import threading, time
def work():
    isomatch.match({str(x)!r}, {str(y)!r}, profile="paper", threads=2)
threading.Thread(target=work, daemon=True).start()
time.sleep(0.4)
"""
        for _ in range(3):
            start = time.monotonic()
            run_python(script)
            self.assertLess(time.monotonic() - start, 10)

    def test_a_slow_function_of_the_caller_skips_snapshots(self):
        seen = []

        def slow(status):
            seen.append(status)
            time.sleep(0.05)

        result = isomatch.match(*support.pair(), on_progress=slow)
        self.assertLess(len(seen), 40)
        self.assertIs(seen[-1].state, isomatch.JobState.SUCCEEDED)
        stages = result.info.stage_seconds
        self.assertAlmostEqual(sum(stages.values()), result.info.run_seconds, delta=0.1)

    def test_what_the_callers_function_raises_ends_it(self):
        seen = []

        def stop(status):
            seen.append(status)
            self.assertIs(threading.current_thread(), threading.main_thread())
            raise LookupError("enough")

        before = threading.active_count()
        with self.assertRaisesRegex(LookupError, "enough"):
            isomatch.match(*support.slow_pair(), on_progress=stop, **support.SLOW)
        self.assertEqual(len(seen), 1)
        self.assertEqual(threading.active_count(), before)


class MemoryTest(unittest.TestCase):
    def test_twenty_matches_leak_nothing(self):
        x, y = isomatch.read_mesh(support.sample("A", 300)), isomatch.read_mesh(support.sample("B", 300))
        grown = []
        for _ in range(25):
            result = isomatch.match(x, y)
            result.page()
            grown.append(resident_bytes())
        # Twenty results and their pages have 30 MB; the heap grows by steps.
        self.assertLess(min(grown[-5:]) - min(grown[3:8]), 8e6, grown)


class OwnMeshesTest(unittest.TestCase):
    def test_what_the_caller_changes_later_changes_nothing(self):
        vertices, faces = isomatch.read_mesh(support.pair()[0])
        vertices, faces = vertices.copy(), faces.astype(np.uint32)
        result = isomatch.match((vertices, faces), support.pair()[1])
        before = result.page()
        vertices[:] = 0
        faces[:] = 10**6
        self.assertEqual(result.page(), before)
        self.assertFalse(result.meshes[0].positions.flags.writeable)

    def test_results_are_short_texts_and_are_told_apart(self):
        one, other = (isomatch.match(*support.pair()) for _ in range(2))
        self.assertIn(other, [one, other])
        self.assertNotEqual(one, other)
        self.assertRegex(repr(one), r"^<isomatch.MatchResult 1000 vertices of X on 900 of Y: good")
        again = pickle.loads(pickle.dumps(one))
        np.testing.assert_array_equal(again.y_from_x, one.y_from_x)
        with self.assertRaisesRegex(TypeError, "prepare it in each"):
            pickle.dumps(isomatch.prepare(support.pair()[0]))


class PreparedTest(unittest.TestCase):
    def test_prepared_meshes_give_the_maps_of_meshes(self):
        x, y = support.pair()
        prepared_x, prepared_y = isomatch.prepare(x), isomatch.prepare(y)
        expected = isomatch.match(x, y).y_from_x
        for pair in ((prepared_x, y), (x, prepared_y), (prepared_x, prepared_y)):
            result = isomatch.match(*pair)
            np.testing.assert_array_equal(result.y_from_x, expected)
            self.assertEqual(result.info.mesh_x.vertices, 1000)
            self.assertIn("</html>", result.page())
        self.assertEqual(repr(prepared_x), "<isomatch.PreparedMesh A1000.off>")

    def test_several_threads_match_at_once(self):
        x, y = support.pair()
        template = isomatch.prepare(x)
        expected = isomatch.match(x, y).y_from_x
        found = []
        threads = [
            threading.Thread(target=lambda: found.append(isomatch.match(template, y).y_from_x))
            for _ in range(4)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(len(found), 4)
        for mapped in found:
            np.testing.assert_array_equal(mapped, expected)

    def test_other_options_are_refused(self):
        prepared = isomatch.prepare(support.pair()[0], solved_vertices=500)
        with self.assertRaisesRegex(isomatch.InvalidInput, "solved_vertices") as caught:
            isomatch.match(prepared, support.pair()[1])
        self.assertEqual(caught.exception.field, "x")

    def test_a_server_takes_them_as_meshes(self):
        x, y = support.pair()
        with support.Server("--ephemeral") as server:
            result = isomatch.match(isomatch.prepare(x), y, server=server.address)
        self.assertEqual(support.as_map_file(result.y_from_x), support.map_of_command_line(x, y))


class ArgumentsTest(unittest.TestCase):
    def expect_field(self, field, said, *pair, **options):
        pair = pair or support.pair()
        with self.assertRaisesRegex(isomatch.InvalidInput, said) as caught:
            isomatch.match(*pair, **options)
        self.assertEqual(caught.exception.field, field)
        self.assertTrue(str(caught.exception).startswith(field))

    def test_what_is_wrong_is_named(self):
        self.expect_field("profile", "'quick', expected default or paper", profile="quick")
        self.expect_field("profile", "is 7, expected 'default' or", profile=7)
        self.expect_field("relation", "'a', expected whole, part-of-y, part-of-x, overlap or auto", relation="a")
        self.expect_field("scale", "is None, expected 'auto' or", scale=None)
        self.expect_field("random_seed", "-1, expected 0 to", random_seed=-1)
        self.expect_field("threads", "is 'two', expected an integer$", threads="two")
        self.expect_field("landmarks_exact", "is 'no', expected", landmarks_exact="no")
        self.expect_field("server", "is '', expected HOST:PORT", server="")
        self.expect_field("x", "is an array alone, expected", *isomatch.read_mesh(support.pair()[0]))
        ragged = isomatch.read_mesh(support.pair()[0])[0], [[0, 1, 2], [0, 1, 2, 3]]
        self.expect_field("x.faces", "expected m x 3 integers", ragged, support.pair()[1])
        self.expect_field("solved_vertices", "20", solved_vertices=20)
        self.expect_field("landmarks[1].y", "900, expected.* 0 to 899", landmarks=[(0, 0), (1, 900)])
        self.expect_field("landmarks[0]", r"\[3\], expected a vertex of X", landmarks=[[3]])
        self.expect_field("landmarks", "is 7, expected", landmarks=7)
        self.expect_field("priority", "is 3, expected 0 without server=", priority=3)
        uploaded = isomatch.UploadedMesh("00", 1, False, 3)
        self.expect_field("y", "expected server= beside it", support.pair()[0], uploaded)

    def test_too_little_memory_is_refused_before_it_is_taken(self):
        self.expect_field("memory_limit_bytes", "expected at least", memory_limit_bytes=2_000_000)


class ProgressTest(unittest.TestCase):
    def setUp(self):
        self.bars = []

        class Bar:
            def __init__(bar, **options):
                self.assertEqual(options["total"], 1.0)
                bar.n, bar.stages, bar.is_closed = 0.0, [], False
                self.bars.append(bar)

            def set_description_str(bar, text, refresh):
                bar.stages.append(text)

            def refresh(bar):
                bar.refreshed = bar.n

            def close(bar):
                bar.is_closed = True

        package = types.ModuleType("tqdm")
        package.__spec__ = mock.Mock()
        package.auto = types.ModuleType("tqdm.auto")
        package.auto.tqdm = Bar
        self.modules = {"tqdm": package, "tqdm.auto": package.auto}

    def test_long_matches_show_a_bar_until_their_end(self):
        with mock.patch.dict(sys.modules, self.modules), mock.patch.object(
            _progress, "_DELAY_SECONDS", 0.0
        ):
            isomatch.match(*support.pair(), progress=True)
        [bar] = self.bars
        self.assertEqual(bar.refreshed, 1)
        self.assertIn("first insertion", bar.stages)
        self.assertTrue(bar.is_closed)

    def test_short_ones_show_none(self):
        with mock.patch.dict(sys.modules, self.modules), mock.patch.object(
            _progress, "_DELAY_SECONDS", 100.0
        ):
            isomatch.match(*support.pair(), progress=True)
        self.assertEqual(self.bars, [])

    def test_nobody_watches_no_bar(self):
        with mock.patch.dict(sys.modules, self.modules):
            with _progress.followed(None, None) as on_status:
                self.assertIsNone(on_status)
            with mock.patch.object(_progress, "_is_watched", return_value=True):
                with _progress.followed(None, None) as on_status:
                    self.assertIsNotNone(on_status)

    def test_without_tqdm_it_is_said(self):
        with mock.patch.object(_progress, "_has_tqdm", return_value=False):
            with self.assertRaisesRegex(isomatch.InvalidInput, "expected tqdm to be installed"):
                isomatch.match(*support.pair(), progress=True)


class LibraryTest(unittest.TestCase):
    def test_every_function_of_the_header_that_is_declared_is_there(self):
        library = _library.load()
        self.assertRegex(library.isomatch_version().decode(), r"^\d+\.\d+\.\d+$")
        self.assertEqual(library.isomatch_version().decode(), isomatch.__version__)


if __name__ == "__main__":
    unittest.main()
