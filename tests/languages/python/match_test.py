"""isomatch.match in this process and on a server: what comes back, in whose numbers."""

import hashlib
import json
import re
import types
import unittest

import numpy as np
import support

import isomatch
from isomatch import _parts as parts


class MatchTest:
    """Wherever it is done."""

    def match(self, *pair, **options):
        return isomatch.match(*pair, server=self.server, **options)

    def test_files_give_the_bytes_of_the_command_line(self):
        x, y = support.pair()
        result = self.match(x, y)
        self.assertEqual(support.as_map_file(result.y_from_x), support.map_of_command_line(x, y))
        self.assertGreater((result.y_from_x == support.truth()).mean(), 0.7)
        self.assertEqual((result.verdict.level, result.verdict.advice), ("good", ""))
        self.assertIn("mean confidence", str(result.verdict))

    def test_a_bad_map_says_so(self):
        dice = np.random.default_rng(1)
        nonsense = dice.normal(size=(500, 3)), dice.integers(0, 500, (1000, 3))
        result = self.match(nonsense, support.pair()[1])
        self.assertEqual(result.verdict.level, "bad")
        self.assertNotEqual(result.verdict.advice, "")

    def test_decimated_meshes_give_the_bytes_of_the_command_line(self):
        # Decimation depends on the order of faces, which Draco does not keep.
        x, y = support.sample("A", 1000), support.sample("C", 6000)
        result = self.match(x, y)
        self.assertEqual(support.as_map_file(result.y_from_x), support.map_of_command_line(x, y))

    def test_arrays_and_objects_give_what_files_give(self):
        x, y = support.pair()
        vertices, faces = isomatch.read_mesh(y)
        trimesh_like = types.SimpleNamespace(vertices=vertices, faces=faces)
        result = self.match(isomatch.read_mesh(x), trimesh_like)
        self.assertEqual(support.as_map_file(result.y_from_x), support.map_of_command_line(x, y))

    def test_the_map_is_in_the_numbers_of_the_arrays(self):
        x, y = support.pair()
        vertices, faces = isomatch.read_mesh(y)
        # Y upside down: vertex i becomes n - 1 - i, and 50 of it are on no face.
        last = len(vertices) - 1
        spare = np.tile([[9.0, 9.0, 9.0]], (50, 1))
        result = self.match(x, (np.vstack([vertices[::-1], spare]), last - faces))
        agree = last - result.y_from_x == self.match(x, y).y_from_x
        self.assertGreater(agree.mean(), 0.9)

    def test_vertices_on_no_face_are_unmatched(self):
        x, y = support.pair()
        vertices, faces = isomatch.read_mesh(x)
        # Few of them travel, many do not: then vertices carry their numbers.
        for spare in (3, 8 * len(vertices)):
            with self.subTest(spare=spare):
                longer = np.vstack([np.zeros((spare, 3)), vertices])
                result = self.match((longer, faces + spare), y)
                self.assertTrue((result.y_from_x[:spare] == -1).all())
                self.assertEqual(
                    support.as_map_file(result.y_from_x[spare:]),
                    support.map_of_command_line(x, y),
                )
                self.assertEqual(result.info.unmatched, spare)
                for values, missing in (
                    (np.arange(900, dtype=np.int32), -1),
                    (np.arange(900, dtype=np.uint8), -1),
                    (np.array(["a"] * 900), ""),
                    (np.ones(900, bool), False),
                ):
                    carried = result.transfer(values)
                    np.testing.assert_array_equal(carried[:spare], [missing] * spare)
                    np.testing.assert_array_equal(carried[spare], values[result.y_from_x[spare]])
                    self.assertIn(carried.dtype, (values.dtype, np.int16))
                weights = result.transfer(np.full((900, 4), 0.25))
                self.assertTrue(np.isnan(weights[:spare]).all())
                np.testing.assert_allclose(weights[spare:], 0.25, atol=1e-6)
                named = result.transfer(np.array(["a"] * 900), missing="none")
                self.assertEqual((named[0], named[-1]), ("none", "a"))

    def test_landmarks_are_kept_or_reported(self):
        true = support.truth()
        result = self.match(
            *support.pair(), landmarks=[(7, true[7]), (300, true[300]), (500, true[20])]
        )
        kept = [outcome.kept for outcome in result.info.landmarks]
        self.assertEqual(kept, [True, True, False])
        self.assertEqual(result.y_from_x[7], true[7])
        self.assertEqual(result.y_from_x[500], result.info.landmarks[2].y_found)

    def test_exact_landmarks_are_all_kept(self):
        wrong = support.truth()[20]
        result = self.match(
            *support.pair(), landmarks=np.array([[500, wrong]]), landmarks_exact=True
        )
        self.assertEqual(result.y_from_x[500], wrong)

    def test_progress_does_not_fall_and_ends(self):
        seen = []
        self.match(*support.pair(), on_progress=seen.append)
        fractions = [status.total_fraction for status in seen]
        self.assertEqual(fractions, sorted(fractions))
        self.assertIs(seen[-1].state, isomatch.JobState.SUCCEEDED)

    def test_parts_come_when_asked_for(self):
        bare = self.match(
            *support.pair(),
            confidence=False, precise=False, functional_map=False, matched_y=False,
        )  # fmt: skip
        self.assertIsNone(bare.confidence)
        self.assertIsNone(bare.precise)
        self.assertIsNone(bare.matched_y)
        with self.assertRaises(isomatch.FailedPrecondition):
            bare.functional_map()
        full = self.match(*support.pair())
        self.assertIn("mask y", full.info.parts)
        self.assertEqual(full.confidence.shape, (1000,))
        self.assertTrue(((full.confidence >= 0) & (full.confidence <= 1)).all())
        np.testing.assert_allclose(full.precise.weights.sum(axis=1), 1, atol=1e-5)
        whole = full.functional_map()
        k = len(whole.eigenvalues_x)
        self.assertEqual(whole.fmap_x_from_y.shape, (k, k))
        self.assertLess(whole.eigenvalues_y[0], 1e-6)
        first = full.functional_map(5)
        self.assertEqual(len(first.eigenvalues_y), 5)
        np.testing.assert_array_equal(first.fmap_x_from_y, whole.fmap_x_from_y[:5, :5])
        for wrong in (0, k + 1):
            with self.assertRaisesRegex(isomatch.InvalidInput, f"k: is {wrong}, expected an integer, 1 to"):
                full.functional_map(wrong)

    def test_which_vertices_of_y_have_a_counterpart_is_told(self):
        x, y = support.pair()
        places, faces = isomatch.read_mesh(y)
        with_stray = np.vstack([[[9, 9, 9]], places])  # on no face
        matched = self.match(x, (with_stray, faces + 1)).matched_y
        self.assertEqual(matched.dtype, np.bool_)
        np.testing.assert_array_equal(matched, np.arange(len(with_stray)) > 0)

    def test_values_are_carried_from_y_to_x(self):
        x, y = support.pair()
        result = self.match(x, y)
        places, _ = isomatch.read_mesh(y)
        labels = np.arange(len(places))
        np.testing.assert_array_equal(result.transfer(labels), result.y_from_x)
        nearest = result.transfer(places, interpolate=False)
        np.testing.assert_array_equal(nearest, places[result.y_from_x])
        # Floating-point numbers are taken between the vertices.
        between = result.transfer(places)
        # Within an edge of each other.
        self.assertLess(np.linalg.norm(nearest - between, axis=1).max(), 0.2)
        self.assertGreater(np.abs(nearest - between).max(), 0)
        weights = np.random.default_rng(1).dirichlet(np.ones(4), len(places))
        np.testing.assert_allclose(result.transfer(weights).sum(axis=1), 1, atol=1e-6)
        names = result.transfer(np.array(["a", "b"])[labels % 2], missing="")
        np.testing.assert_array_equal(names == "b", result.y_from_x % 2 == 1)
        with self.assertRaisesRegex(isomatch.InvalidInput, "expected 900 rows"):
            result.transfer(labels[1:])

    def test_options_are_obeyed(self):
        result = self.match(*support.pair(), random_seed=7, solved_vertices=500)
        self.assertEqual(result.info.random_seed, 7)
        again = self.match(*support.pair(), random_seed=7)
        self.assertFalse((result.y_from_x == again.y_from_x).all())
        with self.assertRaisesRegex(isomatch.InvalidInput, "at least") as refused:
            self.match(*support.pair(), memory_limit_bytes=2_000_000)
        self.assertTrue(refused.exception.field.endswith("memory_limit_bytes"))

    def test_a_deadline_takes_the_map_that_is_there(self):
        seen = []
        early = self.match(*support.pair(), deadline=0.001, on_progress=seen.append)
        self.assertTrue(early.info.ended_early)
        self.assertIn("time was up", " ".join(early.info.warnings))
        self.assertTrue((early.y_from_x >= 0).all())
        self.assertFalse(seen[0].has_map)
        self.assertTrue(seen[-1].has_map)
        self.assertEqual([s.has_map for s in seen], sorted(s.has_map for s in seen))
        self.assertFalse(self.match(*support.pair(), deadline=3600).info.ended_early)
        for wrong in ({"deadline": 0}, {"deadline": -1}, {"deadline": 1, "profile": "paper"}):
            with self.subTest(wrong), self.assertRaises(isomatch.InvalidInput) as refused:
                self.match(*support.pair(), **wrong)
            self.assertEqual(refused.exception.field, "deadline")

    def test_a_part_is_found_in_the_whole(self):
        x, y = support.pair()
        places, faces = isomatch.read_mesh(y)
        lower = places[:, 1] < np.quantile(places[:, 1], 0.55)
        part = faces[lower[faces].all(axis=1)]
        kept, part = np.unique(part, return_inverse=True)
        half = (places[kept] * 3, part.reshape(-1, 3))
        for scale, unit in (("auto", 3), ("same", 1)):
            with self.subTest(scale=scale):
                found = self.match(
                    (half[0] / 3 * unit, half[1]), (places, faces),
                    relation="part-of-y", scale=scale,
                )  # fmt: skip
                off = np.linalg.norm(places[found.y_from_x] - places[kept], axis=1)
                self.assertLess(np.median(off) / np.ptp(places, axis=0).max(), 0.02)
                self.assertAlmostEqual(found.info.scale * unit, 1, delta=0.05)
                self.assertEqual(found.info.relation, "part-of-y")
        found = self.match((half[0] / 3, half[1]), (places, faces), relation="auto",
                           scale="same")  # fmt: skip
        self.assertEqual(found.info.relation, "part-of-y")
        self.assertEqual(found.info.relation_confidence, 1)
        self.assertEqual(found.report()["relation_confidence"], 1)
        with self.assertRaisesRegex(isomatch.InvalidInput, "expected auto") as refused:
            self.match(x, y, scale="same")
        self.assertTrue(refused.exception.field.endswith("scale"))

    def test_the_page_is_that_of_the_command(self):
        x, y = support.pair()
        result = self.match(x, y)
        folder = support.folder()
        parts = [folder / f"page-{name}.txt" for name in ("map", "places", "confidence", "report")]
        # The command's own report has other times.
        parts[3].write_text(json.dumps(result.report()))
        support.run_isomatch(
            "match", x, y, "-o", parts[0], "--precise", parts[1], "--confidence", parts[2],
            "--no-progress",
        )  # fmt: skip
        support.run_isomatch(
            "view", x, y, parts[1], "-o", folder / "page.html", "--confidence", parts[2],
            "--report", parts[3],
        )  # fmt: skip
        of_command, of_result = (
            json.loads(re.search(r'<script[^>]*id="pair">(.*?)</script>', text, re.S).group(1))
            for text in ((folder / "page.html").read_text(), result.page())
        )
        self.assertEqual(of_command.keys(), of_result.keys())
        for key in of_command:
            # Files have fewer digits than arrays.
            if key not in ("precise", "layers", "figures"):
                self.assertEqual(of_command[key], of_result[key], key)
        self.assertEqual(len(of_command["layers"]), len(of_result["layers"]))


class InProcessTest(MatchTest, unittest.TestCase):
    server = None


class OnServerTest(MatchTest, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.server = isomatch.Client()  # an embedded one
        cls.addClassCleanup(cls.server.close)


class DamagedResultTest(unittest.TestCase):
    def test_parts_of_another_size_or_with_foreign_vertices_are_refused(self):
        vertices = np.array([5, 0xFFFFFFFF], "<u4").tobytes()
        np.testing.assert_array_equal(parts.decode_map(vertices, 2, 6), [5, -1])
        for decode, data, said in (
            (parts.decode_map, vertices + b"\0", "9 bytes, expected 8 bytes"),
            (parts.decode_map, np.array([6, 0], "<u4").tobytes(), "vertex 6, expected less than 6"),
            (parts.decode_precise, b"\0" * 47, "47 bytes"),
            (parts.decode_precise, b"\6" * 48, "expected less than 6"),
            (parts.decode_confidence, b"\0" * 12, "12 bytes"),
            (parts.decode_functional_map, b"\2\0\0\0", "4 bytes"),
            (parts.decode_mask_y, b"\1" * 7, "7 bytes, expected 6 bytes"),
            (parts.decode_mask_y, b"\0\1\0\1\2\1", "a byte 2, expected 0 or 1"),
        ):
            with self.assertRaisesRegex(isomatch.DataLoss, said):
                decode(data, 2, 6)

    def test_bytes_of_another_digest_are_refused(self):
        digest = types.SimpleNamespace(size_bytes=4, sha256=hashlib.sha256(b"map.").hexdigest())
        isomatch.Job._verify("map", b"map.", digest)
        for damaged in (b"map", b"map!"):
            with self.assertRaisesRegex(isomatch.DataLoss, "the map arrived damaged"):
                isomatch.Job._verify("map", damaged, digest)


if __name__ == "__main__":
    unittest.main()
