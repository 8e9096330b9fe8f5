#!/usr/bin/env python3
"""Reads an MCAP file by the specification (mcap.dev/spec) with nothing but the standard library and prints its messages,
one line each in the order of the file: topic, log time [ns], size, CRC-32. Every length, offset, count and checksum in
the file is compared with what is there. The chunks must not be compressed.

usage: check_mcap.py FILE
"""
import struct
import sys
import zlib

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, SUMMARY_OFFSET, DATA_END = 0x0B, 0x0E, 0x0F


class Fields:
    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, layout):
        values = struct.unpack_from("<" + layout, self.data, self.at)
        self.at += struct.calcsize("<" + layout)
        return values if len(values) > 1 else values[0]

    def text(self):
        size = self.take("I")
        self.at += size
        assert self.at <= len(self.data)
        return self.data[self.at - size:self.at]

    def end(self):
        assert self.at == len(self.data), "bytes behind the last field"


def records(data, begin, end):
    at = begin
    while at < end:
        op, size = struct.unpack_from("<BQ", data, at)
        assert at + 9 + size <= end
        yield at, op, data[at + 9:at + 9 + size]
        at += 9 + size
    assert at == end


def main(path):
    with open(path, "rb") as file:
        data = file.read()
    assert data.startswith(MAGIC) and data.endswith(MAGIC)
    everything = list(records(data, 8, len(data) - 8))
    assert everything[0][1] == HEADER and everything[-1][1] == FOOTER
    profile = Fields(everything[0][2])
    assert profile.text() == b"ros1"
    summary, offsets, checksum = Fields(everything[-1][2]).take("QQI")
    assert zlib.crc32(data[summary:len(data) - 8 - 4]) == checksum
    schemas, channels, counts, chunks, entries = {}, {}, {}, {}, {}

    def declare(op, content):
        fields = Fields(content)
        if op == SCHEMA:
            number = fields.take("H")
            value = (fields.text(), fields.text(), fields.text())
            assert number != 0 and value[1] == b"ros1msg" and schemas.setdefault(number, value) == value
        else:
            number, schema = fields.take("HH")
            value = (schema, fields.text(), fields.text(), fields.text())
            assert value[2] == b"ros1" and channels.setdefault(number, value) == value
            assert schema == 0 or schema in schemas
            counts.setdefault(number, 0)
        fields.end()

    ended = False
    times = []
    groups = {}
    for at, op, content in everything[1:-1]:
        fields = Fields(content)
        if op == CHUNK:
            assert not ended
            first, last, size, crc = fields.take("QQQI")
            assert fields.text() == b"" and fields.take("Q") == size
            body = content[fields.at:]
            assert len(body) == size and zlib.crc32(body) == crc
            chunks[at] = (first, last, 9 + len(content), size)
            inside = []
            for place, kind, part in records(body, 0, len(body)):
                if kind == MESSAGE:
                    number, _, time, _ = struct.unpack_from("<HIQQ", part)
                    counts[number] += 1
                    inside.append(time)
                    entries.setdefault((at, number), []).append((time, place))
                    print(channels[number][1].decode(), time, len(part) - 22, zlib.crc32(part[22:]))
                else:
                    declare(kind, part)
            assert not inside or (first, last) == (min(inside), max(inside))
            times += inside
            newest = at
        elif op == MESSAGE_INDEX:
            number = fields.take("H")
            packed = fields.text()
            assert list(struct.iter_unpack("<QQ", packed)) == entries[(newest, number)]
            groups.setdefault("index", {})[(newest, number)] = (at, 9 + len(content))
        elif op == DATA_END:
            assert zlib.crc32(data[:at]) == fields.take("I") and summary == at + 13
            ended = True
        elif op in (SCHEMA, CHANNEL):
            declare(op, content)
        elif op == STATISTICS:
            messages, schema_count, channel_count, attachments, metadata, chunk_count, first, last = fields.take("QHIIIIQQ")
            assert messages == sum(counts.values()) and schema_count == len(schemas) and channel_count == len(channels)
            assert attachments == metadata == 0 and chunk_count == len(chunks)
            assert (first, last) == ((min(times), max(times)) if times else (0, 0))
            assert dict(struct.iter_unpack("<HQ", fields.text())) == counts
        elif op == CHUNK_INDEX:
            first, last, begin, length = fields.take("QQQQ")
            places = dict(struct.iter_unpack("<HQ", fields.text()))
            index_length = fields.take("Q")
            assert fields.text() == b""
            stored, size = fields.take("QQ")
            assert chunks.pop(begin) == (first, last, length, size) and stored == size
            own = {number: place for (chunk, number), place in groups.get("index", {}).items() if chunk == begin}
            assert places == {number: place for number, (place, _) in own.items()}
            assert index_length == sum(length for _, length in own.values())
        elif op == SUMMARY_OFFSET:
            kind, begin, length = fields.take("BQQ")
            assert offsets <= at and all(o == kind for _, o, _ in records(data, begin, begin + length))
        else:
            raise AssertionError(f"record {op:#x}")
    assert ended and not chunks


main(sys.argv[1])
