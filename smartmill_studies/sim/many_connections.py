#!/usr/bin/env python3
"""A thousand connections to each server of the running pipeline (panel, MTConnect agent, SHDR adapter, simulated Fanuc): a third idle, a third with a
request whose answer is not read, a third with random bytes. Does another client get its answer, and how late?

usage: devel/env.sh smartmill_studies/sim/many_connections.py [--connections N] [--seed S]           (in the repository's folder)

Exit code 1: another client gets no answer within 1 s, a node ends or is restarted, the connection of cnc_node to the controller is lost, or open
files remain afterwards.
"""
import argparse
import os
import pathlib
import random
import signal
import socket
import subprocess
import sys
import tempfile
import time

from judgement import percentile
from master_restarts import wait
from node_restarts import processes, usage
from production import free_port

ALLOWED = 1.0  # [s]
TRIALS = 30


def get(path):
    return f"GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n".encode()


# What a client requests, and what its answer begins with. The controller's client is cnc_node.
REQUESTS = {"panel": (get("/"), b"HTTP/1.1 200"), "agent": (get("/current"), b"HTTP/1.1 200"), "adapter": (b"* PING\r\n", b"*"), "focas": (b"", b"")}
NODES = {"panel": "panel", "agent": "exchange", "adapter": "exchange", "focas": "sim"}


def answer(port, request, expected):
    """@return [s] until the answer began, or None"""
    began = time.monotonic()
    try:
        with socket.create_connection(("127.0.0.1", port), timeout=ALLOWED) as client:
            client.settimeout(ALLOWED)
            client.sendall(request)
            got = b""
            while len(got) < len(expected):
                part = client.recv(4096)
                if not part:
                    return None
                got += part
            return time.monotonic() - began if got.startswith(expected) else None
    except OSError:
        return None


def crowd(port, number, request, draw):
    """@return open connections, number of refused ones"""
    opened, refused = [], 0
    for k in range(number):
        try:
            client = socket.create_connection(("127.0.0.1", port), timeout=ALLOWED)
            if k % 3 == 1:
                client.sendall(request or draw.randbytes(10))
            elif k % 3 == 2:
                client.sendall(draw.randbytes(draw.randint(1, 2000)))
            opened.append(client)
        except OSError:
            refused += 1
    return opened, refused


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--connections", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    draw = random.Random(arguments.seed)
    failed = []
    with tempfile.TemporaryDirectory() as folder:
        ports = {name: free_port() for name in REQUESTS}
        os.environ.update(ROS_MASTER_URI=f"http://localhost:{free_port()}", ROS_HOSTNAME="localhost", ROS_HOME=folder)
        log_file = pathlib.Path(folder) / "log.txt"
        with open(log_file, "w") as log:
            commands = [["pipeline.launch", "database:=none", f"port:={ports['focas']}", "panel:=true", f"panel_port:={ports['panel']}"],
                        ["exchange.launch", f"agent_port:={ports['agent']}", f"adapter_port:={ports['adapter']}"]]
            graphs = [subprocess.Popen(["roslaunch", "--wait"] * (k > 0) + ["roslaunch"] * (k == 0) +
                                       (["-p", os.environ["ROS_MASTER_URI"].rsplit(":", 1)[1]] if k == 0 else []) + ["smartmill_launch"] + command,
                                       stdout=log, stderr=subprocess.STDOUT) for k, command in enumerate(commands)]
        try:
            ready = lambda: all(answer(ports[name], *REQUESTS[name]) is not None for name in ("panel", "agent", "adapter"))
            if not wait(ready, 90):
                raise RuntimeError("the servers do not start")
            time.sleep(10.0)
            first = processes(folder)
            before = {name: usage(process)[0] for name, process in first.items()}
            for name, (request, expected) in REQUESTS.items():
                client = (lambda: answer(ports[name], request, expected)) if expected else (lambda: 0.0)
                alone = [client() for _ in range(TRIALS)]
                opened, refused = crowd(ports[name], arguments.connections, request, draw)
                among = [client() for _ in range(TRIALS)]
                time.sleep(2.0)
                among += [client() for _ in range(TRIALS)]
                for other in opened:
                    other.close()
                node = NODES[name]
                freed = wait(lambda: usage(first[node])[0] <= before[node] + 5, 30)
                late = [t for t in among if t is None]
                print(f"{name}: {len(opened)} connections, {refused} refused; answer alone {1e3 * percentile(alone, 0.5):.1f} ms, among them median "
                      f"{1e3 * percentile([t for t in among if t is not None] or [float('nan')], 0.5):.1f} ms, longest "
                      f"{1e3 * max((t for t in among if t is not None), default=float('nan')):.1f} ms, {len(late)} of {len(among)} without answer; "
                      f"open files {before[node]} -> {usage(first[node])[0]} afterwards")
                if late:
                    failed.append(f"{name}: {len(late)} of {len(among)} requests of another client had no answer")
                if not freed:
                    failed.append(f"{name}: open files remain")
            last = processes(folder)
            failed += [f"{name} has ended or was restarted" for name in first if last.get(name) != first[name]]
            if "lost" in log_file.read_text(errors="replace") and "connection" in log_file.read_text(errors="replace").split("lost", 1)[1][:200]:
                failed.append("a connection was lost")
        finally:
            for graph in reversed(graphs):
                graph.send_signal(signal.SIGINT)
                graph.wait()
        text = log_file.read_text(errors="replace")
    print("; ".join(failed) or "every other client was served")
    if failed:
        print(text[-3000:], file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
