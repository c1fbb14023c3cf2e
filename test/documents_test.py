#!/usr/bin/python3
"""The documents: links lead somewhere, drawings are those of their script, every key has its line."""

import pathlib
import re
import subprocess
import sys
import tempfile

import roslib.packages
import rosunit

from support.subtests import TestCase

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
PAGES = sorted([*FOLDER.glob("*.md"), *FOLDER.glob("doc/**/*.md"), *FOLDER.glob("examples/**/*.md")])

# Keys that a reader of the scene reads: reader.number("inertia"), scene.quantity("ratio")
ASKED = re.compile(r"\b(?:number|numbers|quantity|text|integer|boolean|choice|names|shafts?|section|has|allow|formula)"
                   r'\(\s*"([a-z_]+)"')
READERS = [*FOLDER.glob("src/laws/*.cpp"), *FOLDER.glob("src/model/*.cpp"),
           FOLDER / "src/ros/node_settings.cpp"]
REFERENCE = ["doc/scene.md", "doc/node.md"]


def without_code(text):
    """The text without fenced and indented blocks and without `code`: nothing in them is a link."""
    text = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"^    .*$", "", text, flags=re.MULTILINE)
    return re.sub(r"`[^`\n]+`", "", text)


def anchors(path):
    """The anchors that GitHub makes of the headings of a page."""
    found = set()
    text = re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    for heading in re.findall(r"^#+ (.*)$", text, flags=re.MULTILINE):
        words = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
        anchor = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
        number = 1
        name = anchor
        while name in found:
            name, number = f"{anchor}-{number}", number + 1
        found.add(name)
    return found


class DocumentsTest(TestCase):

    def test_links(self):
        count = 0
        for page in PAGES:
            for target in re.findall(r"\]\(([^)\s]+)\)", without_code(page.read_text(encoding="utf-8"))):
                if re.match(r"[a-z]+:", target):
                    continue  # of the network: not asked here
                count += 1
                with self.subTest(page=str(page.relative_to(FOLDER)), link=target):
                    name, _, anchor = target.partition("#")
                    file = (page.parent / name).resolve() if name else page
                    self.assertTrue(file.exists(), f"{file} does not exist")
                    if anchor:
                        self.assertIn(anchor, anchors(file))
        self.assertGreater(count, 150)

    def test_every_page_is_in_the_readme(self):
        readme = (FOLDER / "README.md").read_text(encoding="utf-8")
        for page in sorted(FOLDER.glob("doc/**/*.md")):
            with self.subTest(page=page.name):
                self.assertIn(f"]({page.relative_to(FOLDER)})", readme)

    def test_readme_is_short(self):
        lines = (FOLDER / "README.md").read_text(encoding="utf-8").count("\n")
        self.assertLessEqual(lines, 120, "reference belongs on a page of doc/")

    def test_pages_are_few(self):
        """With the README there are at most 18 pages."""
        self.assertLessEqual(1 + len(list(FOLDER.glob("doc/**/*.md"))), 18)

    def test_drawings(self):
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([sys.executable, FOLDER / "scripts/draw_diagrams", "--folder", folder], check=True)
            drawn = sorted(pathlib.Path(folder).iterdir())
            self.assertTrue(drawn)
            for file in drawn:
                with self.subTest(drawing=file.name):
                    self.assertEqual(file.read_bytes(), (FOLDER / "doc/pictures" / file.name).read_bytes(),
                                     "run scripts/draw_diagrams")

    def test_every_key_is_documented(self):
        """The pages of reference have each key that the reader reads, as `key`."""
        text = "\n".join((FOLDER / page).read_text(encoding="utf-8") for page in REFERENCE)
        # `inertia/mean` is the key `mean` too, {order, cos, sin} three keys.
        documented = {word for code in re.findall(r"`([^`\n]+)`|^    (.*)$", text, flags=re.MULTILINE)
                      for word in re.findall(r"[a-z_]+", "".join(code))}
        asked = {(key, file.name) for file in READERS
                 for key in ASKED.findall(file.read_text(encoding="utf-8"))}
        self.assertGreater(len(asked), 100)
        for key, file in sorted(asked):
            with self.subTest(key=key, file=file):
                self.assertIn(key, documented)

    def test_every_documented_key_is_read(self):
        """No key of the tables of doc/scene.md is one that the reader has forgotten."""
        text = (FOLDER / "doc/scene.md").read_text(encoding="utf-8")
        keys = set()
        for table in re.findall(r"^\| key \|.*?\n\n", text, flags=re.MULTILINE | re.DOTALL):
            for cell in re.findall(r"^\| ([^|]+) \|", table, flags=re.MULTILINE):
                keys.update(word for code in re.findall(r"`([^`]+)`", cell) for word in code.split("/"))
        self.assertGreater(len(keys), 40)
        code = "\n".join(file.read_text(encoding="utf-8") for folder in ("src", "include")
                         for file in (FOLDER / folder).rglob("*.*") if file.suffix in (".cpp", ".h"))
        for key in sorted(keys):
            with self.subTest(key=key):
                self.assertIn(f'"{key}"', code)


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "documents_test", DocumentsTest)
