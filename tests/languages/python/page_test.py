"""What a result shows: its page, its report, textures."""

import io
import json
import os
import pathlib
import unittest
from unittest import mock

import numpy as np
import support

import isomatch
from isomatch import _page


class ViewTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.result = isomatch.match(*support.pair())

    def test_a_page_is_written_or_opened(self):
        path = support.folder() / "seen.html"
        with mock.patch("webbrowser.open", return_value=True) as opened, mock.patch.dict(
            os.environ, DISPLAY=":0"
        ):
            self.assertEqual(self.result.view(path), path)
            opened.assert_not_called()
            shown = self.result.view(title="Cat & cat")
            opened.assert_called_once_with(shown.as_uri())
        self.assertIn("A1000.off", path.read_text())
        self.assertIn("Cat & cat", shown.read_text())

    def test_a_notebook_shows_it_in_place(self):
        shown = self.result._repr_html_()
        self.assertTrue(shown.startswith("<iframe srcdoc="))
        self.assertNotIn("<html", shown)  # all of it is quoted
        with mock.patch.object(_page, "_MOST_INLINE_BYTES", 1000):
            self.assertIn("too many for a notebook", self.result._repr_html_())

    def test_any_name_of_a_file_can_be_shown(self):
        x, y = support.pair()
        odd = os.path.join(os.fsencode(support.folder()), b"odd\xff <b>.off")
        pathlib.Path(os.fsdecode(odd)).write_bytes(x.read_bytes())
        for path in (odd, os.fsdecode(odd)):
            self.assertIn("</html>", isomatch.match(path, y).page())
        self.assertIn("</html>", self.result.page(title="a\0b \ud800"))
        with self.assertRaisesRegex(isomatch.InvalidInput, "title: is 5, expected a text"):
            self.result.page(title=5)

    def test_without_a_display_the_page_is_named(self):
        with mock.patch("webbrowser.open") as opened, mock.patch.dict(os.environ):
            for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
                os.environ.pop(name, None)
            with mock.patch("sys.stderr", new_callable=io.StringIO) as said:
                shown = self.result.view()
        opened.assert_not_called()
        self.assertIn(f"no browser found; the page is {shown}", said.getvalue())

    def test_meshes_that_are_not_known_are_asked_for(self):
        x, y = support.pair()
        with support.Server("--ephemeral") as server, isomatch.Client(server.address) as client:
            result = client.submit(client.upload(x), client.upload(y)).result()
            self.assertIsNone(result._repr_html_())
            with self.assertRaisesRegex(isomatch.InvalidInput, "x: is None, expected the mesh"):
                result.page()
            with self.assertRaisesRegex(isomatch.InvalidInput, "has 900 vertices, expected 1000"):
                result.page(x=y, y=x)
            self.assertIn("</html>", result.page(x=x, y=y))

    def test_texture_coordinates_are_carried_to_corners(self):
        x, _ = support.pair()
        itself = isomatch.match(x, x)
        self.assertGreater((itself.y_from_x == np.arange(1000)).mean(), 0.99)
        vertices, faces = isomatch.read_mesh(x)
        uv = vertices[:, :2][faces]
        carried = itself.transfer_texture(uv)
        self.assertLess(np.nanmedian(np.abs(carried - uv)), 1e-3)
        nothing = itself.transfer_texture(np.full_like(uv, np.nan))
        self.assertTrue(np.isnan(nothing).all())
        with self.assertRaisesRegex(isomatch.InvalidInput, r"uv_y: shape is \(3, 2\)"):
            itself.transfer_texture(uv[0])

    def test_the_report_is_that_of_the_command(self):
        x, y = support.pair()
        path = support.folder() / "report.json"
        support.run_isomatch("match", x, y, "-o", "/dev/null", "--report", path, "--no-progress")
        of_command = json.loads(path.read_text())
        of_command.pop("memory_estimate_bytes")
        report = self.result.report()
        self.assertEqual(list(report), list(of_command))
        self.assertEqual(report["seconds"].keys(), of_command["seconds"].keys())
        for measured in ("seconds", "total_seconds", "peak_resident_bytes"):
            of_command.pop(measured)
            self.assertTrue(report.pop(measured))
        self.assertEqual(report, of_command)


if __name__ == "__main__":
    unittest.main()
