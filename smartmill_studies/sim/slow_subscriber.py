#!/usr/bin/env python3
"""What a slow and a stopped subscriber of the running pipeline cost: themselves data, the nodes and the recorder nothing.

usage: devel/env.sh smartmill_studies/sim/slow_subscriber.py [--seconds S] [--out FILE]           (in the repository's folder)

Three phases of S seconds: without such subscribers; with one of each topic of TOPICS that takes 0.2 s for a message; and with one that is
stopped (SIGSTOP). Prints for each phase the longest latency of the nodes' inputs, the messages that they lost, and the memory of the publishers;
at the end what the slow subscribers have received, and the account of the recording. Exit code 1: a node or the recorder lost a message, or a
latency has doubled.
"""
import argparse
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import threading
import time

from judgement import account_of
from production import Graph, await_master

TOPICS = ("daq/dynamometer", "spindle/angle", "force/compensated")
DELAY = 0.2  # [s] of a slow subscriber for each message
PUBLISHERS = ("sim", "kalman")
SETTLING = 10.0  # [s] after the start


def subscribe(delay, out):
    """The subscriber: takes its time for each message, and notes by topic how many it has, how many it lacks, and how late the last was."""
    import rospy
    rospy.init_node("slow_subscriber", anonymous=True)
    seen, lock = {}, threading.Lock()

    def take(message, topic):
        number = message.header.seq
        with lock:
            first, received, _, _ = seen.get(topic, (number, 0, 0, 0.0))
            seen[topic] = (first, received + 1, number - first - received, rospy.Time.now().to_sec() - message.header.stamp.to_sec())
            out.write_text(json.dumps({name: values[1:] for name, values in seen.items()}))
        time.sleep(delay)

    from smartmill_msgs.msg import ForceBlock, SampleBlock, SpindleAngle
    for topic, kind in zip(TOPICS, (SampleBlock, SpindleAngle, ForceBlock)):
        rospy.Subscriber(f"/smartmill/{topic}", kind, take, topic, queue_size=10)
    rospy.spin()


class Health:
    """What the nodes state about their inputs."""

    def __init__(self):
        import rospy
        from smartmill_msgs.msg import NodeHealth
        await_master()
        rospy.init_node("observer", disable_signals=True)
        self.lock = threading.Lock()
        self.begin()
        rospy.Subscriber("/smartmill/health", NodeHealth, self.take, queue_size=1000)

    def begin(self):
        with self.lock:
            self.latency, self.lost, self.memory, self.messages = {}, {}, {}, 0

    def take(self, m):
        with self.lock:
            self.messages += 1
            name = m.node.rsplit("/", 1)[-1]
            self.memory[name] = m.memory / 1e6
            for stream in m.inputs:
                key = f"{name} {stream.topic.replace('/smartmill/', '')}"
                self.lost[key] = stream.lost + stream.lost_samples
                if stream.latency > 0.0:
                    self.latency.setdefault(key, []).append(stream.latency)

    def end(self):
        """@return {longest latency [ms]: median over the seconds of the slowest input; lost messages; memory of the publishers [MB]}"""
        with self.lock:
            medians = {key: sorted(values)[len(values) // 2] for key, values in self.latency.items()}
            slowest = max(medians, key=medians.get)
            return {"latency": 1e3 * medians[slowest], "of": slowest, "lost": sum(self.lost.values()), "reports": self.messages,
                    "memory": {name: self.memory.get(name) for name in PUBLISHERS}}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--out", type=pathlib.Path, help="JSON file for the figures")
    parser.add_argument("--subscriber", type=pathlib.Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.subscriber:
        subscribe(DELAY, arguments.subscriber)
        return 0
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        graph = Graph(folder, 1.0)
        subscribers, phases, received = [], {}, {}

        def start(name):
            child = subprocess.Popen([sys.executable, __file__, "--subscriber", str(folder / name)])
            subscribers.append(child)
            while not (folder / name).exists():
                time.sleep(0.1)
            return child

        def phase(name):
            time.sleep(2.0)
            health.begin()
            time.sleep(arguments.seconds)
            phases[name] = health.end()
            print(f"{name}: {phases[name]}", flush=True)

        try:
            health = Health()
            time.sleep(SETTLING)
            phase("without")
            slow = start("slow")
            phase("slow")
            slow.send_signal(signal.SIGKILL)
            stopped = start("stopped")
            os.kill(stopped.pid, signal.SIGSTOP)
            phase("stopped")
            stopped.send_signal(signal.SIGKILL)
            phase("after")
            received = {name: json.loads((folder / name).read_text()) for name in ("slow", "stopped")}
        finally:
            for child in subscribers:
                child.kill()
                child.wait()
            graph.end()
        account = account_of(folder / "run.bag")[0]
    for name, topics in received.items():
        for topic, (count, missing, late) in topics.items():
            print(f"{name} subscriber, {topic}: {count} messages received, {missing} missing, the last {late:.1f} s after its stamp")
    print(f"account of the recording: {account or 'complete'}")
    lost = sum(p["lost"] for p in phases.values())
    slower = [name for name, p in phases.items() if p["latency"] > 2.0 * phases["without"]["latency"] + 20.0]
    print(f"lost by nodes: {lost}; phases in which the nodes were slower: {', '.join(slower) or 'none'}")
    if arguments.out:
        arguments.out.write_text(json.dumps({"phases": phases, "received": received, "account": account}, indent=1) + "\n")
    return 1 if lost or slower or account else 0


if __name__ == "__main__":
    sys.exit(main())
