"""Output files: written whole or not at all; devices, FIFOs and links stay what they are."""

import contextlib
import itertools
import os
import stat
import sys


def find_regular_file(path):
    """The regular file that `path` is or leads to, or would be; None where it leads to a device, a FIFO or a socket.

    Raises IsADirectoryError.
    """
    path = os.fspath(path)
    with contextlib.suppress(FileNotFoundError):
        mode = os.stat(path).st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(f"'{path}' is a folder")
        if not stat.S_ISREG(mode):
            return None
    return os.path.realpath(path)


def _create_beside(path):
    for number in itertools.count():
        part = f"{path}.{os.getpid()}.{number}.part"
        with contextlib.suppress(FileExistsError):
            return part, os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)


@contextlib.contextmanager
def writing(path):
    """An OSError in here is one of writing `path`: it names that file, and has it as its `output`."""
    try:
        yield
    except OSError as error:
        error.filename = error.output = os.fspath(path)
        raise


@contextlib.contextmanager
def printing():
    """What is printed in here is on its way at the end; a reader that has seen enough is no error."""
    try:
        with writing("standard output"):
            yield
            sys.stdout.flush()
    except OSError as error:
        # The rest of the buffer must not fail once more when the program ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            raise


def check_writable(path):
    """Raises OSError where a file could not be written there: before what takes long."""
    with writing(path):
        target = find_regular_file(path)
        if target is not None:
            part, descriptor = _create_beside(target)
            os.close(descriptor)
            os.unlink(part)


@contextlib.contextmanager
def whole_file(path, mode="w"):
    """Opens a file, "w" or "wb", that takes the place of the old one once all of it is on the disk."""
    with writing(path), _whole_file(path, mode) as file:
        yield file


@contextlib.contextmanager
def _whole_file(path, mode):
    how = {} if "b" in mode else {"encoding": "utf-8", "newline": ""}
    target = find_regular_file(path)
    if target is None:
        with open(path, mode, **how) as file:
            yield file
        return
    part, descriptor = _create_beside(target)
    try:
        with os.fdopen(descriptor, mode, **how) as file:
            yield file
            file.flush()
            with contextlib.suppress(FileNotFoundError):
                os.fchmod(descriptor, stat.S_IMODE(os.stat(target).st_mode))
            os.fsync(descriptor)
        os.replace(part, target)
    except BaseException:
        os.unlink(part)
        raise


def write_bytes(path, data):
    with whole_file(path, "wb") as file:
        file.write(data)
