#!/usr/bin/env python3
"""Reads dataset 58 from its definition (SDRC I-DEAS Test Universal File Format, "Function at Nodal DOF"), independent of the library.

usage: read_uff.py FILE; prints one JSON list: type, name, response, reference, numerator, abscissa [1e-6], real and imaginary part [1e-12] of each
function, rounded to integers, so that they can be compared as text.

Records: lines 1 to 5 text; 6: type (10 columns) ... response entity (10), node (10), direction (4), reference entity (10), node (10), direction (4) in
columns 1-5, 6-15, 16-20, 21-30, 31, 32-41, 42-51, 52-55, 56, 57-66, 67-76, 77-80; 7: ordinate type (2 real single, 4 real double, 5 complex single,
6 complex double), number of points, spacing (0 uneven, 1 even), minimum, increment, z; 8 to 11: kind of data and unit of abscissa, ordinate
numerator, denominator, z. Binary (58b): the header states byte order (1 little, 2 big) in columns 8-13, the number of header lines in 20-31, that of bytes in 32-43."""
import json
import struct
import sys

SINGLE, DOUBLE = "f", "d"
FORMATS = {2: (SINGLE, 1), 4: (DOUBLE, 1), 5: (SINGLE, 2), 6: (DOUBLE, 2)}
DELIMITER = b"    -1"

data, at, found = open(sys.argv[1], "rb").read(), 0, []


def line():
    global at
    end = data.index(b"\n", at)
    text, at = data[at:end].rstrip(b"\r"), end + 1
    return text


while at < len(data):
    if line().rstrip() != DELIMITER:
        continue
    head = line()
    assert head[:6].strip() == b"58", head
    binary = head[6:7] == b"b"
    names = [line().decode().strip() for _ in range(5)]
    six = line().decode().ljust(80)
    seven = line().decode().split()
    kinds = [line().decode() for _ in range(4)]
    ordinate, points, even = (int(word) for word in seven[:3])
    low, step = float(seven[3]), float(seven[4])
    letter, parts = FORMATS[ordinate]
    count = points * (parts + (0 if even else 1))
    if binary:
        order, size = "<" if head[7:13].strip() == b"1" else ">", int(head[31:43])
        body, at = data[at:at + size], at + size
        # The abscissa of uneven data has the precision of the values, as programs write it; the definition states it for text only.
        values = struct.unpack(order + letter * count, body)
    else:
        values = []
        while len(values) < count:
            values += [float(word.replace("D", "E")) for word in line().decode().split()]
        assert len(values) == count
    stride = parts + (0 if even else 1)
    shift = 0 if even else 1
    found.append({"type": int(six[0:5]), "name": names[0], "response": [int(six[41:51]), int(six[51:55])],
                  "reference": [int(six[66:76]), int(six[76:80])], "numerator": int(kinds[1].split()[0]),
                  "abscissa_um": [round(1e6 * (low + step * i if even else values[stride * i])) for i in range(points)],
                  "real_pm": [round(1e12 * values[stride * i + shift]) for i in range(points)],
                  "imag_pm": [round(1e12 * values[stride * i + shift + 1]) if parts == 2 else 0 for i in range(points)]})
    while line().rstrip() != DELIMITER:
        pass
print(json.dumps(found))
