"""The notebook of client/python/examples, executed by a kernel as Jupyter does it."""

import os
import pathlib
import sys
import unittest

import nbclient
import nbformat
import support

NOTEBOOK = pathlib.Path(os.environ["ISOMATCH_EXAMPLES"]) / "first_map.ipynb"


class NotebookTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        # The kernel is this Python, whatever others are installed for Jupyter.
        kernels = support.folder() / "jupyter/kernels/python3"
        kernels.mkdir(parents=True)
        (kernels / "kernel.json").write_text(
            '{"argv": ["%s", "-m", "ipykernel_launcher", "-f", "{connection_file}"], '
            '"display_name": "Python 3", "language": "python"}' % sys.executable
        )
        os.environ["JUPYTER_PATH"] = str(support.folder() / "jupyter")
        binaries = pathlib.Path(support.CLIENT_BINARY).parent
        os.environ["PATH"] = f"{binaries}:{os.environ['PATH']}"
        cls.notebook = nbformat.read(NOTEBOOK, as_version=4)
        nbclient.NotebookClient(cls.notebook, timeout=120, kernel_name="python3").execute()

    def outputs(self, source):
        """Of the cell that has this in it."""
        [cell] = [cell for cell in self.notebook.cells if source in cell.source]
        return cell.outputs

    def said(self, source):
        return "".join(output.get("text", "") for output in self.outputs(source))

    def test_the_map_shows_itself(self):
        [shown] = [output for output in self.outputs("isomatch.match(folder") if "data" in output]
        self.assertTrue(shown["data"]["text/html"].startswith("<iframe srcdoc="))
        self.assertIn("<isomatch.MatchResult 3000 vertices of X on 3000 of Y: good", shown["data"]["text/plain"])

    def test_its_cells_say_what_their_texts_promise(self):
        self.assertTrue(self.said("result.verdict").startswith("good"))
        self.assertIn("(3000,)", self.said("height ="))
        self.assertIn("(2, 3000, 3)", self.said("isomatch.prepare"))
        self.assertRegex(self.said("functional_map(20)"), r"^\[1\. ")

    def test_it_is_kept_without_outputs(self):
        kept = nbformat.read(NOTEBOOK, as_version=4)
        nbformat.validate(kept)
        for cell in kept.cells:
            self.assertFalse(cell.get("outputs"))


if __name__ == "__main__":
    unittest.main()
