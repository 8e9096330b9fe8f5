"""Reads a file written by `export` with the library of its kind (scipy, h5py, csv): a line for each column with
stream, name, unit, number of values, first, last and sum of the values.

usage: check_export.py FILE|FOLDER
"""

import csv
import pathlib
import sys


def row(stream, name, unit, values):
    values = [float(value) for value in values]
    print(stream, name, unit, len(values), repr(values[0]), repr(values[-1]), repr(sum(values)))


def mat(path):
    from scipy.io import loadmat

    for stream, held in loadmat(path, squeeze_me=True).items():
        if stream.startswith("__"):
            continue
        for name in held.dtype.names:
            if name + "_unit" in held.dtype.names:
                row(stream, name, str(held[name + "_unit"][()]), held[name][()])


def hdf5(path):
    import h5py

    def visit(name, item):
        if isinstance(item, h5py.Dataset):
            unit = item.attrs["unit"]
            row(name.rpartition("/")[0], item.name.rpartition("/")[2], unit.decode(), item[()])

    with h5py.File(path) as file:
        file.visititems(visit)


def table(folder):
    for path in sorted(pathlib.Path(folder).glob("*.csv")):
        with open(path, newline="", encoding="utf-8") as file:
            rows = list(csv.reader(file))
        for column, title in enumerate(rows[0]):
            name, unit = title.rstrip("]").split("[")
            row(path.stem, name, unit, [cells[column] for cells in rows[1:]])


def main():
    path = sys.argv[1]
    if path.endswith(".mat"):
        mat(path)
    elif path.endswith(".h5"):
        hdf5(path)
    else:
        table(path)


main()
