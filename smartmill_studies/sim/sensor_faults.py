#!/usr/bin/env python3
"""Faults of sensors in the running graph: a recorded session is replayed to the nodes (replay.launch faults:=true), one fault of one stream at
a time, and their results are compared with those of the replay without a fault.

usage: devel/env.sh smartmill_studies/sim/sensor_faults.py [--session BAG] [--only WORD] [--out FILE]   (in the repository's folder)
--session: recorded session; without it a short one is recorded first. Prints a table: fault, who announced it and after how many seconds of
the stream's stamps, result of each consumer while the fault lasted. Exit code 1: a fault was not announced, a result was silently wrong, or the
replay without a fault announced one.

Results: right; withheld (missing or NaN); marked (status passed_through or settling, invalid state); wrong (differs by more than 5 %), silent
unless the fault was announced within 0.5 s.
"""
import argparse
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile

from production import ROOT, free_port

LASTS = 4.0      # [s] of each fault
PROMPT = 0.5     # [s] time in which a fault is to be announced
WRONG = 0.05     # [1] difference of a result that counts as wrong
DYNAMOMETER, ANGLE, HAMMER = "daq/dynamometer", "spindle/angle", "daq/hammer"
COMMON = ("off", "stuck", "garbage", "scale", "sign", "slow", "delayed", "intermittent", "duplicated", "clock_step")
FAULTS = [(DYNAMOMETER, fault) for fault in (*COMMON, "swapped", "wrong_rate")]
FAULTS += [(ANGLE, fault) for fault in COMMON]
FAULTS += [(HAMMER, fault) for fault in ("off", "stuck", "garbage", "intermittent", "duplicated", "wrong_rate")]


def launch(log, *arguments):
    """Runs roslaunch to its end. @return its output, lines NODE LEVEL TIME TEXT"""
    environment = {**os.environ, "ROS_HOSTNAME": "localhost", "ROS_HOME": str(log.parent / "home"),
                   "ROSCONSOLE_FORMAT": "@${node} ${severity} ${message}"}
    with open(log, "wb") as out:
        child = subprocess.Popen(["roslaunch", "-p", str(free_port()), *arguments], stdout=out, stderr=subprocess.STDOUT, env=environment)
        try:
            child.wait(540)
        finally:
            if child.poll() is None:
                child.send_signal(signal.SIGINT)
                child.wait(60)
    return re.sub(r"\x1b\[[0-9;]*m", "", log.read_text(errors="replace"))


def record_session(folder):
    parameters = folder / "session.yaml"
    short = (ROOT / "launch/test/short_session.yaml").read_text()
    for key, value in (("slot_time", 3.0), ("least_slot_time", 2.0), ("resonance_time", 5.0)):
        short = re.sub(rf"^{key}:.*$", f"{key}: {value}", short, flags=re.M)
    parameters.write_text(short)
    bag = folder / "session.bag"
    text = launch(folder / "session.log", "smartmill_launch", "pipeline.launch", "session:=true", "pace:=3.0", f"bag:={bag}",
                  f"port:={free_port()}", "database:=none", f"session_params:={parameters}", f"summary:={folder / 'session.json'}")
    if not bag.exists():
        raise RuntimeError("no session:\n" + text[-3000:])
    return bag


class Results:
    """What the nodes published in a replay, between two stamps."""

    def __init__(self, bag, begin, end):
        import rosbag
        self.force, self.status, self.chatter, self.coefficients, self.frf = {}, {}, [], None, None
        with rosbag.Bag(str(bag)) as file:
            for topic, message, _ in file.read_messages():
                stamp = message.header.stamp.to_sec()
                name = topic.replace("/smartmill/", "")
                if name == "material/coefficients":
                    self.coefficients = message.value.ktc if hasattr(message, "value") else message.ktc
                elif name == "tool/frf" and message.point == "tool_tip":
                    self.frf = max((re * re + im * im) ** 0.5 for re, im in zip(message.real, message.imag))
                elif name == "force/compensated" and begin <= stamp < end:
                    self.force[message.first_index] = (message.fx, message.fy)
                    self.status[message.first_index] = message.status
                elif name == "chatter/state" and begin <= stamp < end and message.valid:
                    self.chatter.append((stamp, message.chatter))


def rms(values):
    return (sum(v * v for v in values) / max(1, len(values))) ** 0.5


def force_verdict(healthy, faulty):
    """@return shares of the healthy blocks: right, withheld, marked, wrong"""
    shares = dict.fromkeys(("right", "withheld", "marked", "wrong"), 0)
    samples = {}
    for first, block in faulty.force.items():  # blocks of another length are compared sample by sample
        for i in range(len(block[0])):
            samples[first + i] = (block[0][i], block[1][i], faulty.status[first])
    scale = rms([v for block in healthy.force.values() for axis in block for v in axis if v == v])
    for first, block in healthy.force.items():
        pairs = [samples.get(first + i) for i in range(len(block[0]))]
        measured = [(p, i) for i, p in enumerate(pairs) if p and p[0] == p[0] and p[1] == p[1]]
        if 2 * len(measured) < len(pairs):
            shares["withheld"] += 1
        elif any(p[2] != healthy.status[first] for p, _ in measured):
            shares["marked"] += 1
        else:
            error = rms([p[axis] - block[axis][i] for p, i in measured for axis in (0, 1)])
            shares["wrong" if error > WRONG * scale else "right"] += 1
    return {key: count / max(1, len(healthy.force)) for key, count in shares.items()}


def chatter_verdict(healthy, faulty):
    """As force_verdict(), of the valid states"""
    shares = dict.fromkeys(("right", "withheld", "marked", "wrong"), 0)
    for stamp, chatter in healthy.chatter:
        near = [c for s, c in faulty.chatter if abs(s - stamp) < 0.05]
        shares["withheld" if not near else "right" if chatter in near else "wrong"] += 1
    return {key: count / max(1, len(healthy.chatter)) for key, count in shares.items()}


def value_verdict(healthy, faulty):
    if healthy is None:
        return "none to compare"
    if faulty is None:
        return "withheld"
    return "right" if abs(faulty / healthy - 1.0) < WRONG else f"wrong ({100 * (faulty / healthy - 1.0):+.0f} %)"


def words(shares):
    return ", ".join(f"{key} {100 * share:.0f} %" for key, share in shares.items() if share >= 0.005) or "none"


LINE = re.compile(r"@/smartmill/(\w+) +(?:ERROR|WARN) (.*)")


def announcements(text, topic, begin, end):
    """@return [(s after the beginning, node, text)] of the first line about the topic of each node"""
    first = {}
    for node, line in LINE.findall(text):
        if not line.startswith((topic, "force/compensated")):
            continue
        at = re.search(r" at (\d+\.\d+) s", line)
        since = re.search(r"no data for (\d+\.\d+) s of the other inputs, since (\d+\.\d+) s", line)
        stamp = float(at.group(1)) if at else float(since.group(1)) + float(since.group(2)) if since else None
        if stamp is None or not begin - 1.0 <= stamp <= end + 1.0 or node in first:
            continue
        first[node] = (stamp - begin, node, line)
    return sorted(first.values())


def in_steady_cut(condition, position):
    """Slots are along x."""
    begin, end = condition.steady_from, condition.steady_to
    return begin.x < position[0] < end.x and abs(position[1] - begin.y) < 1e-3 and abs(position[2] - begin.z) < 1e-3


class Study:
    def __init__(self, folder, bag):
        self.folder, self.bag, self.rows = folder, bag, []
        self.begins = self.find_begins()
        self.healthy_bags = {}
        _, text = self.replay("healthy", "")
        self.false_alarms = [f"{node} {line}" for node, line in LINE.findall(text) if line.startswith((DYNAMOMETER, ANGLE, HAMMER, "force/compensated"))]

    def find_begins(self):
        """Stamps of the first message of each stream, and of the beginning of the fault."""
        import rosbag
        firsts, cuts, hits, condition = {}, [], [], None
        with rosbag.Bag(str(self.bag)) as file:
            for topic, message, _ in file.read_messages(topics=["/smartmill/" + t for t in (DYNAMOMETER, ANGLE, HAMMER, "cut/condition", "cnc/state")]):
                name, stamp = topic.replace("/smartmill/", ""), message.header.stamp.to_sec()
                if name == "cut/condition":
                    condition = message if message.kind == message.CUT else None
                    continue
                if name == "cnc/state":
                    if condition and in_steady_cut(condition, message.position):
                        cuts.append(stamp)
                        condition = None
                    continue
                firsts.setdefault(name, stamp)
                if name == HAMMER and max(message.samples[message.channels.index("hammer")::len(message.channels)]) > 50.0:
                    hits.append(stamp)
        # In the steady part of the second slot, after its first verdict on chatter; the hammer's before the second hit.
        begins = {DYNAMOMETER: cuts[1] + 0.6, ANGLE: cuts[1] + 0.6, HAMMER: hits[0] + 0.2}
        return {topic: (firsts[topic], begin) for topic, begin in begins.items()}

    def replay(self, name, faults):
        out = self.folder / f"{name}.bag"
        text = launch(self.folder / f"{name}.log", "smartmill_launch", "replay.launch", f"bag:={self.bag}", f"out:={out}", "rate:=0",
                      "faults:=true", f"fault_list:={faults}")
        if not out.exists():
            raise RuntimeError(f"{name}: no results\n" + text[-3000:])
        return out, text

    def results(self, bag, topic):
        begin = self.begins[topic][1]
        return Results(bag, begin, begin + LASTS)

    def row(self, topic, fault):
        first, begin = self.begins[topic]
        name = f"{topic.replace('/', '_')}_{fault}"
        bag, text = self.replay(name, f"{topic} {fault} {begin - first:.4f} {LASTS}")
        healthy, faulty = self.results(self.folder / "healthy.bag", topic), self.results(bag, topic)
        announced = announcements(text, topic, begin, begin + LASTS)
        force, chatter = force_verdict(healthy, faulty), chatter_verdict(healthy, faulty)
        coefficients = value_verdict(healthy.coefficients, faulty.coefficients)
        frf = value_verdict(healthy.frf, faulty.frf) if topic == HAMMER else None
        prompt = bool(announced) and announced[0][0] <= PROMPT
        wrong = force["wrong"] > 0.02 or chatter["wrong"] > 0.02 or coefficients.startswith("wrong") or (frf or "").startswith("wrong")
        row = {"topic": topic, "fault": fault, "announced_after": announced[0][0] if announced else None,
               "announced_by": [f"{node} {after:.2f} s" for after, node, _ in announced], "line": announced[0][2] if announced else None, "force": force,
               "chatter": chatter, "coefficients": coefficients, "frf": frf, "silently_wrong": wrong and not prompt}
        self.rows.append(row)
        print(f"{topic} | {fault} | {', '.join(row['announced_by']) or 'no node'} | {words(force)} | {words(chatter)} | {coefficients} | "
              f"{frf or '-'} | {'SILENTLY WRONG' if row['silently_wrong'] else 'wrong, announced' if wrong else ''}", flush=True)
        bag.unlink()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--session", type=pathlib.Path, metavar="BAG", help="recorded session; default: a short one is recorded")
    parser.add_argument("--only", default="", metavar="WORD", help="only the faults 'TOPIC FAULT' that contain WORD")
    parser.add_argument("--out", type=pathlib.Path, help="JSON file for the rows")
    parser.add_argument("--folder", type=pathlib.Path, help="folder for logs and recordings; default: a temporary one")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="sensor_faults") as temporary:
        folder = options.folder or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        study = Study(folder, options.session.resolve() if options.session else record_session(folder))
        print("topic | fault | announced | force/compensated | chatter/state | material/coefficients | tool/frf | verdict")
        for topic, fault in FAULTS:
            if options.only in f"{topic} {fault}":
                study.row(topic, fault)
    if options.out:
        options.out.write_text(json.dumps(study.rows, indent=1) + "\n")
    silent = [r for r in study.rows if r["silently_wrong"]]
    late = [r for r in study.rows if r["announced_after"] is None or r["announced_after"] > PROMPT]
    print(f"{len(study.rows)} faults; not announced within {PROMPT} s: {', '.join(r['topic'] + ' ' + r['fault'] for r in late) or 'none'}; "
          f"silently wrong: {', '.join(r['topic'] + ' ' + r['fault'] for r in silent) or 'none'}")
    print(f"announced in the replay without a fault: {'; '.join(study.false_alarms) or 'none'}")
    return 1 if silent or late or study.false_alarms else 0


if __name__ == "__main__":
    sys.exit(main())
