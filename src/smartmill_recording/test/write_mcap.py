#!/usr/bin/env python3
"""Writes a small MCAP file by the specification (mcap.dev/spec) with nothing but the standard library: the reference
that the reader is tested with. Message k of 20 is a SpindleAngle with angle k and speed 100 + k, received at (10 + k) s,
neighbours swapped in the file; another channel has an encoding of its own.

usage: write_mcap.py chunks|loose|bare FILE    chunks: in two chunks, with summary; loose: without chunks, with summary;
                                               bare: in chunks, without summary and checksums
"""
import struct
import sys
import zlib

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = range(9, 16)
DEFINITION = ("std_msgs/Header header\nfloat64 angle # [rad]\nfloat64 speed\n" + "=" * 80 + "\nMSG: std_msgs/Header\n"
              "uint32 seq\ntime stamp\nstring frame_id\n")
SECOND = 10 ** 9


def text(value):
    data = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(data)) + data


def record(op, content):
    return struct.pack("<BQ", op, len(content)) + content


def mapped(values):
    return text(b"".join(text(k) + text(v) for k, v in values.items()))


def declarations():
    return [record(SCHEMA, struct.pack("<H", 1) + text("smartmill_msgs/SpindleAngle") + text("ros1msg") + text(DEFINITION)),
            record(SCHEMA, struct.pack("<H", 2) + text("note") + text("jsonschema") + text("{}")),
            record(CHANNEL, struct.pack("<HH", 7, 1) + text("/smartmill/spindle/angle") + text("ros1") + mapped({"callerid": "/cnc"})),
            record(CHANNEL, struct.pack("<HH", 8, 2) + text("/note") + text("json") + mapped({}))]


def message(k):
    seconds = 10 + k
    data = struct.pack("<III", k, seconds, 0) + text("") + struct.pack("<dd", k, 100.0 + k)
    return seconds * SECOND, record(MESSAGE, struct.pack("<HIQQ", 7, k, seconds * SECOND, seconds * SECOND) + data)


def chunk(messages, begin, checked):
    """(chunk and message index records, chunk index record)"""
    body = b"".join(declarations()) if begin == 0 else b""
    entries = b""
    for time, data in messages:
        entries += struct.pack("<QQ", time, len(body))
        body += data
    times = [time for time, _ in messages]
    span = struct.pack("<QQ", min(times), max(times))
    checksum = zlib.crc32(body) if checked else 0
    out = record(CHUNK, span + struct.pack("<QI", len(body), checksum) + text("") + struct.pack("<Q", len(body)) + body)
    index = record(MESSAGE_INDEX, struct.pack("<H", 7) + text(entries))
    return out, index, span, len(body)


def main(kind, path):
    order = [k ^ 1 for k in range(20)]
    messages = [message(k) for k in order]
    out = MAGIC + record(HEADER, text("ros1") + text("reference"))
    indexes = []
    if kind == "loose":
        out += b"".join(declarations()) + b"".join(data for _, data in messages)
        out += record(METADATA, text("origin") + mapped({"by": "reference"}))
    else:
        for begin in (0, 11):
            part = messages[:11] if begin == 0 else messages[11:]
            data, index, span, size = chunk(part, begin, kind == "chunks")
            offsets = struct.pack("<HQ", 7, len(out) + len(data))
            indexes.append(record(CHUNK_INDEX, span + struct.pack("<QQ", len(out), len(data)) + text(offsets)
                                  + struct.pack("<Q", len(index)) + text("") + struct.pack("<QQ", size, size)))
            out += data + index
        attachment = struct.pack("<QQ", 0, 0) + text("note.txt") + text("text/plain") + struct.pack("<Q", 5) + b"hello"
        out += record(ATTACHMENT, attachment + struct.pack("<I", zlib.crc32(attachment)))
    out += record(DATA_END, struct.pack("<I", 0 if kind == "bare" else zlib.crc32(out)))
    if kind == "bare":
        out += record(FOOTER, struct.pack("<QQI", 0, 0, 0)) + MAGIC
    else:
        start = len(out)
        statistics = (struct.pack("<QHIIII", 20, 2, 2, int(kind == "chunks"), int(kind == "loose"), len(indexes))
                      + struct.pack("<QQ", 10 * SECOND, 29 * SECOND) + text(struct.pack("<HQ", 7, 20)))
        summary = b"".join(declarations()) + record(STATISTICS, statistics) + b"".join(indexes)
        footer = struct.pack("<BQQQ", FOOTER, 20, start, 0)
        out += summary + footer + struct.pack("<I", zlib.crc32(summary + footer)) + MAGIC
    with open(path, "wb") as file:
        file.write(out)


main(*sys.argv[1:])
