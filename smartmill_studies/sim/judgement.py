"""What a recording, the database and the reports of the nodes say of a run: losses, wrong forces, missing records, growth."""
import concurrent.futures
import math
import multiprocessing
import re
import sqlite3
import statistics
import struct
import subprocess

import numpy
import rosbag

from production import COMPENSATED

WRONG = 0.5             # [1] error of a block's RMS over that of the true force from which it is wrong
LEAST_FORCE = 20.0      # [N] RMS of a block that is judged
STEADY = 0.3            # [1] range of the RMS of five blocks in a steady cut
AFTER = 2.0             # [s] simulated after a fault, in which its consequences end


def force_blocks(bag):
    """@return {first_index: (stamp, status, forces)} of force/compensated and sim/truth/force"""
    found = {"/smartmill/force/compensated": {}, "/smartmill/sim/truth/force": {}}
    with rosbag.Bag(str(bag)) as file:
        for topic, raw, _ in file.read_messages(topics=list(found), raw=True):
            data = raw[1]
            seconds, nanoseconds, length = struct.unpack_from("<4xIII", data)
            at = 16 + length
            first = struct.unpack_from("<Q", data, at + 8)[0]
            at += 16
            axes = []
            for _ in range(2):
                count = struct.unpack_from("<I", data, at)[0]
                axes.append(numpy.frombuffer(data, "<f8", count, at + 4))
                at += 4 + 8 * count
            found[topic][first] = (seconds + 1e-9 * nanoseconds, data[-1], numpy.concatenate(axes))
    return found.values()


def unmarked(bag, faults):
    """@return blocks of compensated force that are wrong, have the status COMPENSATED and lie outside the faults; blocks judged.
    Entries and exits, whose force changes within a block, are not judged."""
    compensated, true = force_blocks(bag)
    wrong = judged = 0
    order = sorted(true)
    levels = numpy.array([numpy.sqrt(numpy.mean(true[first][2] ** 2)) for first in order])
    for k in range(2, len(order) - 2):
        level, near = levels[k], levels[k - 2 : k + 3]
        block = compensated.get(order[k])
        if block is None or level < LEAST_FORCE or near.max() > (1.0 + STEADY) * near.min():
            continue
        (stamp, status, force), truth = block, true[order[k]][2]
        if status != COMPENSATED or len(truth) != len(force) or any(begin <= stamp <= end + AFTER for begin, end, *_ in faults) or not numpy.isfinite(force).all():
            continue
        judged += 1
        wrong += bool(numpy.sqrt(numpy.mean((force - truth) ** 2)) > WRONG * level)
    return wrong, judged


def unstored(database, cuts, faults):
    """@return what is wrong with the records of the cuts; number of records that had to be there. Cuts without states of the controller, or during
    which loadmeter was killed, have none."""
    with sqlite3.connect(database) as connection:
        whole = connection.execute("PRAGMA integrity_check").fetchone()[0]
        if whole != "ok":
            return ["database: " + whole], 0
        records = [stamp for (stamp,) in connection.execute("SELECT stamp FROM coefficients")]
    unrecorded = [f for f in faults if f[2] in ("disconnect", "corrupt") or f[3] == "cnc" or f[2:] == ["kill", "loadmeter"]]
    wrong, owed = [], 0
    for begin, end in cuts:
        if any(start < end + AFTER and until > begin - AFTER for start, until, *_ in unrecorded):
            continue
        owed += 1
        number = sum(begin <= stamp <= end for stamp in records)
        if number != 1:
            wrong.append(f"database: {number} records of the cut from {begin:.1f} to {end:.1f} s, expected 1")
    return wrong, owed


def account_of(*parts):
    """@return lost between publishers and recorder or nodes, lines of the account, starts of each node"""
    done = subprocess.run(["smartmill", "account", *map(str, parts)], capture_output=True, text=True)
    lines = done.stdout.splitlines()
    lost = [line for line in lines if "lost between publisher" in line]
    if done.returncode not in (0, 3):
        lost.append(done.stderr.strip())
    nodes = [line.split() for line in lines if re.match(r"/smartmill/\w+ +\d+ +\d+ +\d+ +\d+ +\d+$", line)]
    lost += [f"{words[0]} lost {words[3]} messages" for words in nodes if int(words[3]) > 0]
    return lost, lines, [words[1] for words in nodes]


def judge(part, following, faults):
    """@param following the next part of the recording, or None @return lost, samples, wrong blocks, judged blocks of a part"""
    lost, lines, _ = account_of(part)
    if following:
        lost = account_of(part, following)[0]
    samples = sum(int(words[3]) for words in (line.split() for line in lines) if len(words) > 8 and words[0] == "/smartmill/daq/dynamometer")
    return (lost, samples, *unmarked(part, faults))


class Parts:
    """Judges the parts of a recording once they are complete, in a process of its own, and deletes all but the last two, so that a long run does not
    need the disk of its recording."""

    def __init__(self, bag):
        self.bag, self.next, self.results, self.pending = bag, 0, [], None
        self.process = concurrent.futures.ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))

    def part(self, number):
        return self.bag if number == 0 else self.bag.with_name(f"{self.bag.stem}_{number}{self.bag.suffix}")

    def collect(self, faults):
        """Takes the next part that is complete together with its successor, unless one is being judged."""
        if self.pending:
            if not self.pending.done():
                return
            self.results.append(self.pending.result())
            if self.next > 2:
                self.part(self.next - 3).unlink()
            self.pending = None
        if self.part(self.next + 1).exists():
            self.submit(self.part(self.next + 1), faults)

    def submit(self, following, faults):
        self.pending = self.process.submit(judge, self.part(self.next), following, faults)
        self.next += 1

    def finish(self, faults):
        """@return lost, samples, wrong blocks, judged blocks of the recording"""
        while self.part(self.next).exists():
            if self.pending:
                self.results.append(self.pending.result())
            following = self.part(self.next + 1)
            self.submit(following if following.exists() else None, faults)
        if self.pending:
            self.results.append(self.pending.result())
        self.process.shutdown()
        lost = sorted({line for result in self.results for line in result[0]})
        return (lost, *(sum(result[k] for result in self.results) for k in (1, 2, 3)))


def draw(series, file):
    """Memory, open files, threads, latency and processor time of the nodes over the wall time. @param file *.png"""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    titles = ("memory [MB]", "open files", "threads", "longest latency of a second [ms]", "processor time [% of a core]")
    figure, axes = plt.subplots(len(titles), sharex=True, figsize=(9, 12), layout="constrained")
    begin = min(rows[0][0] for rows in series.values())
    for node, rows in sorted(series.items()):
        columns = numpy.array(rows).T
        hours = (columns[0] - begin) / 3600
        for axis, column, factor in zip(axes, columns[1:], (1e-6, 1, 1, 1e3, 100)):
            axis.plot(hours, factor * column, label=node.split("/")[-1], linewidth=0.8)
    for axis, title in zip(axes, titles):
        axis.set_title(title, loc="left", fontsize="medium")
        axis.set_ylim(bottom=0)
    axes[0].legend(ncols=4, fontsize="small")
    axes[-1].set_xlabel("wall time [h]")
    figure.savefig(file, dpi=100)


def percentile(values, share):
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, math.ceil(share * len(ordered)) - 1)]


def growth(series):
    """Memory, descriptors, threads and latency from the second minute on: first and last quarter. @return text of each node"""
    lines = []
    for node, rows in sorted(series.items()):
        rows = [row for row in rows if row[0] > rows[0][0] + 60]
        quarter = max(1, len(rows) // 4)
        if len(rows) < 8:
            continue
        def mean(part, column):
            return statistics.fmean(row[column] for row in part)
        ends = rows[:quarter], rows[-quarter:]
        values = [tuple(mean(part, column) for part in ends) for column in range(1, 6)]
        lines.append(f"{node}: memory {values[0][0] / 1e6:.1f} -> {values[0][1] / 1e6:.1f} MB, descriptors {values[1][0]:.0f} -> {values[1][1]:.0f}, "
                     f"threads {values[2][0]:.0f} -> {values[2][1]:.0f}, latency {1e3 * values[3][0]:.0f} -> {1e3 * values[3][1]:.0f} ms, cpu {100 * values[4][1]:.0f} %")
    return lines
