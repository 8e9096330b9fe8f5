#!/usr/bin/env python3
"""Wall and CPU time of the parts of a long command: when each of the known programs ran, and the CPU time of it and its children.
Used by .ci/bare in a process namespace of its own.

usage: watch_parts.py FILE                                            records until SIGTERM; one line of FILE for each part
       watch_parts.py --cpu FILE                                      CPU minutes of all parts
       watch_parts.py --table FILE --history LOG --archives N         rows of a table; LOG is apt's history, N the number of downloads
"""
import csv
import datetime
import os
import pathlib
import re
import signal
import sys
import time

PARTS = {"apt": "apt", "apt-get": "apt", "cmake": "configure", "ninja": "compile", "roslaunch": "roslaunch", "ctest": "tests",
         "lintian": "lintian", "dpkg-buildpackage": "dpkg-buildpackage"}
PERIOD = 0.5  # [s]
TICK = os.sysconf("SC_CLK_TCK")


def processes():
    """Process id -> (name, parent, CPU seconds with those of children that ended)."""
    found = {}
    for entry in pathlib.Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            text = (entry / "stat").read_text()
            arguments = (entry / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue  # ended in the meantime
        head, tail = text.rsplit(")", 1)
        fields = tail.split()
        name = head.split("(", 1)[1]
        # A script carries its interpreter's name.
        if name.startswith(("python", "perl", "roslaunch")) and len(arguments) > 1:
            name = os.path.basename(arguments[1].decode(errors="replace"))
        found[int(entry.name)] = (name, int(fields[1]), sum(int(f) for f in fields[11:15]) / TICK)
    return found


def outermost(pid, table):
    """Whether no ancestor of a process is a part itself."""
    parent = table[pid][1]
    while parent in table:
        if table[parent][0] in PARTS:
            return False
        parent = table[parent][1]
    return True


def live_cpu(pid, table):
    """CPU seconds of a process and of all that descend from it."""
    return table[pid][2] + sum(live_cpu(child, table) for child in table if table[child][1] == pid)


def watch(path):
    parts = {}

    def end(*_):
        with open(path, "w", newline="") as file:
            writer = csv.writer(file)
            for (_, name), (begin, last, cpu) in sorted(parts.items(), key=lambda p: p[1][0]):
                writer.writerow([name, f"{begin:.1f}", f"{last:.1f}", f"{cpu:.1f}"])
        sys.exit(0)

    signal.signal(signal.SIGTERM, end)
    while True:
        table = processes()
        now = time.time()
        for pid, (name, _, _) in table.items():
            if name in PARTS and outermost(pid, table):
                begin, _, cpu = parts.get((pid, name), (now, now, 0.0))
                parts[pid, name] = (begin, now, max(cpu, live_cpu(pid, table)))
        time.sleep(PERIOD)


def read(path):
    with open(path, newline="") as file:
        return [(name, float(begin), float(last), float(cpu)) for name, begin, last, cpu in csv.reader(file)]


def unpacking(history):
    """Seconds in which apt unpacked and configured packages, from its history."""
    dates = [datetime.datetime.strptime(d, "%Y-%m-%d  %H:%M:%S")
             for d in re.findall(r"^(?:Start|End)-Date: (.*)$", pathlib.Path(history).read_text(), re.M)]
    return sum((end - start).total_seconds() for start, end in zip(dates[::2], dates[1::2]))


def table(path, history, archives):
    merged = []  # consecutive parts of one kind are one row
    for name, begin, last, cpu in read(path):
        part = PARTS[name]
        if merged and merged[-1][0] == part and part != "roslaunch":
            merged[-1] = (part, merged[-1][1] + last - begin, merged[-1][2] + cpu)
        else:
            merged.append((part, last - begin, cpu))
    for part, wall, cpu in merged:
        if wall < 1.0:
            continue
        seen = ""
        if part == "apt":
            inside = unpacking(history)
            seen = (f"lists and download {max(0.0, wall - inside) / 60:.1f} ({archives} archives, the others were cached), "
                    f"unpack and configure {inside / 60:.1f}")
        print(f"| - {part} | {wall / 60:.1f} | {cpu / 60:.1f} | {seen} |")


def main():
    if sys.argv[1] == "--cpu":
        print(f"{sum(part[3] for part in read(sys.argv[2])) / 60:.1f}")
    elif sys.argv[1] == "--table":
        table(sys.argv[2], sys.argv[4], sys.argv[6])
    else:
        watch(sys.argv[1])


main()
