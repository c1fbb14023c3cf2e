"""Test cases: subtests that rosunit tells of, as its results show neither which one failed nor why, and folders."""

import contextlib
import pathlib
import tempfile
import traceback
import unittest


class TestCase(unittest.TestCase):

    @contextlib.contextmanager
    def subTest(self, message=None, **parameters):
        """As unittest's: the test goes on behind a failure. All of them fail it at its end, by name."""
        try:
            yield
        except unittest.SkipTest:
            raise
        except Exception:
            if not hasattr(self, "_failed"):
                self._failed = []
                self.addCleanup(self._tell_failed)
            words = [] if message is None else [str(message)]
            words += [f"{name}={value!r}" for name, value in parameters.items()]
            self._failed.append(f"subtest {', '.join(words)}:\n{traceback.format_exc()}")

    def _tell_failed(self):
        failed, self._failed = self._failed, []
        raise self.failureException("\n".join([f"{len(failed)} subtests failed", *failed]))


class FolderTestCase(TestCase):
    """With a folder of its own for each test."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def write(self, name, text):
        path = self.folder / name
        path.write_text(text, encoding="utf-8")
        return str(path)
