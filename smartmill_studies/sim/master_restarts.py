#!/usr/bin/env python3
"""The ROS master of the running pipeline is killed and started again, many times: how long until every node is registered as before, and what
was lost.

usage: devel/env.sh smartmill_studies/sim/master_restarts.py [--times N] [--seed S] [--without SECONDS]           (in the repository's folder)
--without: longest time without a master; each time is drawn up to it.

Prints the times from the start of the new master to the full registration, and the account of the recording. Exit code 1: a node was not
registered again within 30 s, or a message of a sensor, the controller or the forces was lost.
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

from judgement import account_of, percentile
from production import Graph, free_port

LONGEST = 30.0  # [s]


def registered():
    """@return {(kind, topic or service, node)} of the nodes of SmartMill and the recorder"""
    import rosgraph
    try:
        state = rosgraph.Master("/observer").getSystemState()
    except (OSError, rosgraph.MasterException):
        return set()
    return {(kind, name, node) for kind, entries in enumerate(state) for name, nodes in entries for node in nodes
            if node.startswith("/smartmill/") or node in ("/record", "/frames")}


def wait(condition, seconds):
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--times", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--without", type=float, default=3.0)
    arguments = parser.parse_args()
    draw, port = random.Random(arguments.seed), free_port()

    def master():
        return subprocess.Popen(["rosmaster", "--core", "-p", str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    os.environ.update(ROS_MASTER_URI=f"http://localhost:{port}", ROS_HOSTNAME="localhost")
    with tempfile.TemporaryDirectory() as folder:
        running = master()
        graph = Graph(pathlib.Path(folder), 1.0, port)
        times, failed = [], []
        try:
            if not wait(lambda: len({node for _, _, node in registered()}) >= 9, 60):
                raise RuntimeError("the graph does not start")
            time.sleep(12.0)  # connections, and the copy of the parameters that a node makes every ten seconds
            before = registered()
            for k in range(arguments.times):
                running.send_signal(signal.SIGKILL)
                running.wait()
                time.sleep(draw.uniform(0.0, arguments.without))
                running = master()
                began = time.monotonic()
                if not wait(lambda: before <= registered(), LONGEST):
                    failed.append(f"restart {k + 1}: {sorted(before - registered())[:3]}")
                    break
                times.append(time.monotonic() - began)
                time.sleep(draw.uniform(0.5, 2.0))
                if (k + 1) % 10 == 0:
                    print(f"{k + 1} restarts, longest {max(times):.2f} s", file=sys.stderr, flush=True)
        finally:
            graph.end()
            running.terminate()
        text = (pathlib.Path(folder) / "log.txt").read_text(errors="replace")
        lost, lines, starts = account_of(pathlib.Path(folder) / "run.bag")
    announced = text.count("new ROS master at ")
    print(f"{len(times)} restarts of the master ({len(before)} registrations of {len({node for _, _, node in before})} nodes), {announced} announcements of nodes, "
          f"starts of the nodes {', '.join(starts)}")
    if times:
        print(f"registered again: median {percentile(times, 0.5):.2f} s, 99 % {percentile(times, 0.99):.2f} s, longest {max(times):.2f} s")
    print("\n".join(failed + lost) or "no message lost: " + lines[-1])
    return 1 if failed or lost else 0


if __name__ == "__main__":
    sys.exit(main())
