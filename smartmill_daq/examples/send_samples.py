#!/usr/bin/env python3
"""Reference sender of SmartMill's frames (docs/daq.md): a device that streams sines by TCP to each client that connects. Copy
frame() into a sender of your own."""
import argparse
import math
import socket
import struct
import time

INT16, INT32, FLOAT32, FLOAT64 = 1, 2, 3, 4
CODES = {INT16: "h", INT32: "i", FLOAT32: "f", FLOAT64: "d"}


def frame(sample_format, channels, first_index, values, rate=0.0, time_ns=0, overloaded=0, bias_fault=0):
    """One frame. values: interleaved, codes of the integer formats or volts; rate [Hz] and time_ns [ns] of the first sample: 0
    where not stated; overloaded, bias_fault: one bit per channel."""
    payload = struct.pack(f"<{len(values)}{CODES[sample_format]}", *values)
    header = struct.pack("<4sBBHIIQqdQQ", b"SMD1", sample_format, channels, 0, len(values) // channels, len(payload),
                         first_index, time_ns, rate, overloaded, bias_fault)
    return header + payload


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, default=5045, help="port on the loopback interface; 0: any free one (default 5045)")
    parser.add_argument("--rate", type=float, default=51200.0, help="sample rate [Hz] (default 51200)")
    parser.add_argument("--ppm", type=float, default=0.0, help="by which the converter runs fast (default 0)")
    parser.add_argument("--channels", type=int, default=6, help="1 to 64 (default 6)")
    parser.add_argument("--seconds", type=float, default=0.0, help="ends after this time; 0: with the connection")
    arguments = parser.parse_args()

    samples = max(1, round(0.005 * arguments.rate))
    period = max(1, round(1.0 / 0.005))  # blocks of a second, after which the sines repeat
    channels = arguments.channels
    # Volts: channel c is a sine of 100 (c + 1) Hz and an amplitude of 1 V.
    blocks = [[math.sin(2.0 * math.pi * 100.0 * (c + 1) * (b * samples + i) / arguments.rate)
               for i in range(samples) for c in range(channels)] for b in range(period)]
    server = socket.create_server(("127.0.0.1", arguments.port))
    print(f"listening on {server.getsockname()[1]}", flush=True)
    connection, _ = server.accept()
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    begin, index = time.monotonic(), 0
    true_rate = arguments.rate * (1.0 + 1e-6 * arguments.ppm)
    try:
        while arguments.seconds == 0.0 or index < arguments.seconds * arguments.rate:
            pause = begin + (index + samples) / true_rate - time.monotonic()
            if pause > 0.0:
                time.sleep(pause)
            connection.sendall(frame(FLOAT32, channels, index, blocks[index // samples % period], arguments.rate))
            index += samples
    except (BrokenPipeError, ConnectionResetError):
        pass
    print(f"{index} samples sent")


main()
