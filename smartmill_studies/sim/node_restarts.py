#!/usr/bin/env python3
"""A node of the running pipeline is killed and started again, many times: is it registered again each time, and what do the other processes gain in
open files, threads and memory?

usage: devel/env.sh smartmill_studies/sim/node_restarts.py [--times N] [--node kalman] [--seed S]           (in the repository's folder)

Exit code 1: a start was not registered within 30 s, or another process has ten open files or threads, or 10 MB, more at the end.
"""
import argparse
import os
import pathlib
import random
import signal
import subprocess
import sys
import tempfile
import time

from judgement import percentile
from master_restarts import wait
from production import free_port

LONGEST = 30.0  # [s]
RUNNING = 0.6  # [s] at most between two kills: before and after its connections are complete
SETTLING = 20.0  # [s] before the processes are compared


def processes(home):
    """@return {node: process} of the launch whose logs are in home"""
    found = {}
    for entry in pathlib.Path("/proc").iterdir():
        try:
            command = (entry / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        names = [word[8:].decode() for word in command if word.startswith(b"__name:=")]
        if names and any(str(home).encode() in word for word in command):
            found[names[0]] = int(entry.name)
    return found


def usage(process):
    """@return open files, threads, resident memory [MB]"""
    status = dict(line.split(":", 1) for line in pathlib.Path(f"/proc/{process}/status").read_text().splitlines())
    return len(os.listdir(f"/proc/{process}/fd")), int(status["Threads"]), int(status["VmRSS"].split()[0]) / 1000.0


def half_closed():
    """@return number of connections in CLOSE_WAIT on this computer"""
    return sum(line.split()[3] == "08" for name in ("tcp", "tcp6") for line in pathlib.Path(f"/proc/net/{name}").read_text().splitlines()[1:])


def main():
    import rosgraph
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--times", type=int, default=1000)
    parser.add_argument("--node", default="kalman")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    draw = random.Random(arguments.seed)
    with tempfile.TemporaryDirectory() as folder:
        port = free_port()
        os.environ.update(ROS_MASTER_URI=f"http://localhost:{port}", ROS_HOSTNAME="localhost", ROS_HOME=folder)
        with open(pathlib.Path(folder) / "log.txt", "w") as log:
            graph = subprocess.Popen(["roslaunch", "-p", str(port), "smartmill_launch", "pipeline.launch", "respawn:=false", "database:=none",
                                      f"port:={free_port()}"], stdout=log, stderr=subprocess.STDOUT)
        node, own, failed, times = f"/smartmill/{arguments.node}", None, [], []
        master = rosgraph.Master("/observer")

        def address():
            try:
                return master.lookupNode(node)
            except (OSError, rosgraph.MasterException):
                return ""

        try:
            if not wait(lambda: len(processes(folder)) >= 8 and address(), 60):
                raise RuntimeError("the graph does not start")
            time.sleep(SETTLING)
            first = processes(folder)
            process = first.pop(arguments.node)
            command = pathlib.Path(f"/proc/{process}/cmdline").read_bytes().split(b"\0")[:-1]
            environment = dict(pair.split(b"=", 1) for pair in pathlib.Path(f"/proc/{process}/environ").read_bytes().split(b"\0") if b"=" in pair)
            before, waiting = {name: usage(other) for name, other in first.items()}, half_closed()
            for k in range(arguments.times):
                earlier = address()
                os.kill(process, signal.SIGKILL)
                if own:
                    own.wait()
                began = time.monotonic()
                own = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                process = own.pid
                if not wait(lambda: address() not in ("", earlier), LONGEST):
                    failed.append(f"start {k + 1} was not registered within {LONGEST:.0f} s")
                    break
                times.append(time.monotonic() - began)
                time.sleep(draw.uniform(0.0, RUNNING))
                if (k + 1) % 100 == 0:
                    print(f"{k + 1} restarts, longest {max(times):.2f} s, {half_closed()} connections in CLOSE_WAIT", file=sys.stderr, flush=True)
            time.sleep(SETTLING)
            last = processes(folder)
            for name, (files, threads, memory) in sorted(before.items()):
                if last.get(name) != first[name]:
                    failed.append(f"{name} has ended")
                    continue
                now = usage(first[name])
                print(f"{name}: {files} -> {now[0]} open files, {threads} -> {now[1]} threads, {memory:.1f} -> {now[2]:.1f} MB")
                if now[0] > files + 10 or now[1] > threads + 10 or now[2] > memory + 10.0:
                    failed.append(f"{name} has grown")
            print(f"connections in CLOSE_WAIT: {waiting} -> {half_closed()}")
        finally:
            if own:
                own.kill()
            graph.send_signal(signal.SIGINT)
            graph.wait()
    print(f"{len(times)} restarts of {arguments.node}; registered after: median {percentile(times, 0.5):.2f} s, 99 % {percentile(times, 0.99):.2f} s, "
          f"longest {max(times):.2f} s")
    print("; ".join(failed) or "no process has grown")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
