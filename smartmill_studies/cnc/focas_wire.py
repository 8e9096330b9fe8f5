"""Frames of FOCAS between bridge and controller: a session that reads the motion, a proxy with faults, replies that are wrong."""
import socket
import struct
import threading

from ros_processes import PATIENCE, free_port

MAGIC = b"\xa0" * 4
ERROR, DATA, DNC_START = 3, 0x21, 0x19


def frame_of(kind, direction, body, version=1):
    return MAGIC + struct.pack(">HBBH", version, kind, direction, len(body)) + body


def close_down(end):
    try:
        end.shutdown(socket.SHUT_RDWR)
    except OSError:
        pass


class Wire:
    """Frames of one connection."""

    def __init__(self, connection):
        self.socket, self.rest, self.waiting = connection, b"", []

    def frames(self):
        """Complete frames received. @raises ConnectionError at the end."""
        data = self.socket.recv(65536)
        if not data:
            raise ConnectionError("closed")
        self.rest += data
        whole = []
        while len(self.rest) >= 10:
            size = 10 + struct.unpack(">H", self.rest[8:10])[0]
            if len(self.rest) < size:
                break
            whole.append(self.rest[:size])
            self.rest = self.rest[size:]
        return whole


class Observer:
    """A separate session that reads positions, spindle and state from the controller."""

    def __init__(self, port):
        self.wires = []
        for circuit in (1, 2):
            wire = Wire(socket.create_connection(("127.0.0.1", port), PATIENCE))
            wire.socket.sendall(frame_of(1, 1, struct.pack(">H", circuit)))
            self.wires.append(wire)
            if self.receive(wire)[7] == ERROR:
                self.close()
                raise ConnectionError("refused")

    @staticmethod
    def receive(wire):
        while not wire.waiting:
            wire.waiting += wire.frames()
        return wire.waiting.pop(0)

    def request(self, opcode, *values):
        values = (list(values) + [0] * 5)[:5]
        self.wires[1].socket.sendall(frame_of(DATA, 1, struct.pack(">HHHHH5i", 1, 0x1C, 1, 1, opcode, *values)))
        body = self.receive(self.wires[1])[10:]
        return body[18:]

    def read(self):
        """(x, y, z [mm], spindle [rpm], run, blocks)"""
        position, speed = self.request(0x26, 1, -1), self.request(0x25)
        values = [struct.unpack(">iHh", (position + speed)[8 * i:8 * i + 8]) for i in range(4)]
        run = struct.unpack(">7h", self.request(0x19)[:14])[1]
        return [value / base**exponent for value, base, exponent in values] + [run, struct.unpack(">i", self.request(0x35))[0]]

    def close(self):
        for wire in self.wires:
            wire.socket.close()


class Proxy:
    """Forwards frames through `down` (controller to bridge) and `up`, which return the bytes to send, in a tuple to hang up after them."""

    def __init__(self, target):
        self.target, self.port, self.ends = target, free_port(), []
        self.calm()
        self.listen()

    def listen(self):
        self.listener = socket.create_server(("127.0.0.1", self.port))
        threading.Thread(target=self.accept, args=(self.listener,), daemon=True).start()

    def shut(self):
        """As a stopped server: connections end, further ones are refused."""
        for end in (self.listener, *self.ends):
            close_down(end)
        self.listener.close()
        self.ends = []

    def calm(self):
        self.down = self.up = lambda frame: frame
        self.byte_by_byte = False

    def accept(self, listener):
        while True:
            try:
                client, _ = listener.accept()
            except OSError:
                return
            try:
                server = socket.create_connection(("127.0.0.1", self.target), 5)
            except OSError:
                client.close()
                continue
            for end in (client, server):
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                end.settimeout(None)
                self.ends.append(end)
            for source, sink, way in ((client, server, "up"), (server, client, "down")):
                threading.Thread(target=self.serve, args=(source, sink, way), daemon=True).start()

    def serve(self, source, sink, way):
        wire = Wire(source)
        try:
            while True:
                for frame in wire.frames():
                    data = getattr(self, way)(frame)
                    hang_up = isinstance(data, tuple)
                    data = data[0] if hang_up else data
                    for piece in ([data[i:i + 1] for i in range(len(data))] if self.byte_by_byte else [data]):
                        sink.sendall(piece)
                    if hang_up:
                        raise ConnectionError("cut")
        except OSError:
            pass
        close_down(source)
        close_down(sink)


def spoiled(change):
    def down(frame):
        if frame[6] != DATA:
            return frame
        wrong = bytearray(frame)
        change(wrong)
        return bytes(wrong)
    return down


def set_at(position, *values):
    def change(frame):
        frame[position:position + len(values)] = bytes(values)
    return change


def wrong_opcode(frame):
    frame[19] ^= 0x55


def flood(frame):
    foreign = frame_of(0x33, 2, bytes(90), 3)
    return foreign * 101 + frame if frame[6] == DATA else frame
