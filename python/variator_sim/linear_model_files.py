"""Makes files of NumPy and MATLAB of linear models.

`simulate --linearize` runs this file by itself: it reads the model as CSV from standard input and writes the
content of the file to standard output, or the reason why there is none (exit status 1). So it imports nothing of the
package, whose compiled module is not needed here.
"""

import collections
import csv
import io
import sys

SHAPES = {"A": ("states", "states"), "B": ("states", "inputs"), "C": ("outputs", "states"), "D": ("outputs", "inputs"),
          "x": ("states",), "u": ("inputs",), "y": ("outputs",), "x_rate": ("states",), "time": ()}
NAMED_BY = {"states": "x", "inputs": "u", "outputs": "y"}


def read(text):
    """Names and arrays of a model's CSV: "states", "A", .."""
    import numpy
    rows = collections.defaultdict(list)
    for row in csv.DictReader(io.StringIO(text)):
        rows[row["matrix"]].append(row)
    names = {kind: [row["row"] for row in rows[vector]] for kind, vector in NAMED_BY.items()}
    model = {}
    for name, kinds in SHAPES.items():
        values = numpy.array([float(row["value"]) for row in rows[name]])
        model[name] = values.reshape([len(names[kind]) for kind in kinds])
    model.update((kind, numpy.array(texts, dtype=str)) for kind, texts in names.items())
    return model


def _write_npz(text, file):
    import numpy
    if text:
        numpy.savez(file, **read(text))


def _write_mat(text, file):
    import scipy.io
    if text:
        columns = {name: array[:, None] if name in SHAPES and array.ndim == 1 else array
                   for name, array in read(text).items()}
        scipy.io.savemat(file, columns, format="4")


WRITERS = {".npz": (_write_npz, "python3-numpy"), ".mat": (_write_mat, "python3-scipy")}


def convert(text, ending):
    """The content of a file with this ending, of a model's CSV; of an empty text nothing.

    Raises ImportError where what writes it is not installed.
    """
    write, package = WRITERS[ending]
    file = io.BytesIO()
    try:
        write(text, file)
    except ImportError as error:
        raise ImportError(f"{ending} needs {package} ({error}): 'apt install {package}' installs it, "
                          "and .csv needs nothing") from error
    return file.getvalue()


def main():
    del sys.path[0]  # modules of the package are none of NumPy's or SciPy's
    try:
        sys.stdout.buffer.write(convert(sys.stdin.read(), sys.argv[1]))
    except ImportError as error:
        print(error, end="")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
