#!/usr/bin/python3
"""The cells of doc/tutorials run, in order, as a notebook runs them."""

import json
import os
import pathlib

os.environ["ROS_MASTER_URI"] = "http://localhost:1"

import matplotlib  # noqa: E402
matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import roslib.packages  # noqa: E402
import rosunit  # noqa: E402

from support.subtests import TestCase  # noqa: E402

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE)) / "doc/tutorials"


class NotebooksTest(TestCase):

    def test_notebooks(self):
        notebooks = sorted(FOLDER.glob("*.ipynb"))
        self.assertTrue(notebooks)
        for notebook in notebooks:
            cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
            names = {"__name__": "__main__"}
            for number, cell in enumerate(cells):
                if cell["cell_type"] == "code":
                    with self.subTest(notebook=notebook.name, cell=number):
                        exec(compile("".join(cell["source"]), f"{notebook.name}[{number}]", "exec"),
                             names)
            folder = os.environ.get("VARIATOR_SIM_PICTURES")  # to look at them
            for figure in plt.get_fignums() if folder else []:
                plt.figure(figure).savefig(f"{folder}/{notebook.stem}_{figure}.png", dpi=60)
            self.assertEqual(len(plt.get_fignums()), 3)


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "notebooks_test", NotebooksTest)
