#!/usr/bin/env python3
"""Production on the simulated machine while processes are killed, stopped and starved, sensors are faulty, the controller is disconnected,
replies and ports get invalid bytes and the disk is full, at random; an observer checks what must hold.

usage: devel/env.sh smartmill_studies/sim/chaos.py [--seeds N] [--first S] [--seconds T] [--pace P] [--without-faults] [--out FOLDER]
                                                                                              (in the repository's folder)
--seeds: number of runs, each with the next seed from --first on. --seconds: wall time of a run, without its start and end. --pace:
simulated time per wall time. --without-faults: production alone; memory, descriptors, threads and latency of the nodes are compared from
the second minute on. --out: folder for the recording and log of each run that violates a rule, for runs.jsonl, and without faults for a picture of
the nodes' memory, open files, threads, latency and processor time.

Prints one line per run and the figures over all. Exit code 1: a rule was violated. Without the right to mount a file system (unshare) the disk
is never full, which the first line states.

Rules: no feed and no spindle rotation 2 s after motion was disarmed or the bridge has lost the controller, no position beyond the limits of the
model, every message between publisher and recorder and every sample accounted for, forces that are wrong are marked or announced, the database
is whole, no cut that a full disk refused is missing in it afterwards, and within 30 s after a fault the graph is in full service again without a
person: all nodes report, forces are compensated, and a program runs.
"""
import argparse
import json
import math
import os
import pathlib
import random
import shutil
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time

from judgement import Parts, draw, growth, percentile, unstored
from production import NODES, OWN_MOUNTS, STANDSTILL, STREAMS, Graph, Observer, focas_wire

# With the words of StreamCheck's table: faults that the stream alone shows. A wrong scale, sign or order does not.
SENSOR_FAULTS = ("off", "stuck", "garbage", "delayed", "intermittent", "duplicated", "clock_step", "slow")
KINDS = ("kill", "stop", "starve", "sensor", "disconnect", "corrupt", "fill")
REPLIES = {"version 0": focas_wire.spoiled(focas_wire.set_at(5, 0)), "a length beyond the frame": focas_wire.spoiled(focas_wire.set_at(12, 0xFF)),
           "another request's reply": focas_wire.spoiled(focas_wire.wrong_opcode), "no frame": focas_wire.spoiled(focas_wire.set_at(1, 0)),
           "half a frame": lambda frame: (frame[:11],), "none": lambda frame: b"", "10,000 foreign bytes before it": focas_wire.flood}
INTRUDERS = 8           # connections with invalid bytes to each port of a node
RECOVERY = 30.0         # [s] wall, in which the graph must be in full service again
MEAN_PAUSE = 4.0        # [s] wall, between full service and the next fault


class Faults:
    """Draws the faults of a seed and makes them."""

    def __init__(self, seed, observer, graph):
        self.random, self.observer, self.graph = random.Random(seed), observer, graph
        self.kinds = [kind for kind in KINDS if kind != "fill" or graph.disk.mounted]

    def make(self):
        """@return kind, what, end of the fault (wall), whether its direct consequence is over"""
        draw = self.random
        kind = draw.choice(self.kinds)
        node, length = draw.choice(NODES), draw.uniform(0.3, 3.0)
        what, is_over = getattr(self, kind)(node, length)
        return kind, what, time.monotonic(), is_over or (lambda: True)

    def kill(self, node, _):
        process = self.observer.process_of(node)
        if process is None:
            return node + " (not there)", None
        before = self.observer.starts_of(node)
        os.kill(process, signal.SIGKILL)
        return node, lambda: self.observer.starts_of(node) not in (before, None)

    def stop(self, node, length):
        process = self.observer.process_of(node)
        if process is None:
            return node + " (not there)", None
        os.kill(process, signal.SIGSTOP)
        time.sleep(length)
        try:
            os.kill(process, signal.SIGCONT)
        except ProcessLookupError:
            pass
        return node, None

    @staticmethod
    def starve(_, length):
        computing = f"import time\nend = time.monotonic() + {length}\nwhile time.monotonic() < end: pass"
        busy = [subprocess.Popen([sys.executable, "-c", computing]) for _ in range(2 * os.cpu_count())]
        for process in busy:
            process.wait()
        return f"{length:.1f} s", None

    def sensor(self, _, length):
        rospy, stream, fault = self.observer.rospy, self.random.choice(STREAMS), self.random.choice(SENSOR_FAULTS)
        try:
            answer = self.observer.fault_service(topic=stream, fault=fault, duration=length, value=0.0)
            what = f"{stream} {fault}" + ("" if answer.code == 0 else f" refused: {answer.message}")
        except rospy.ServiceException as error:
            what = f"{stream} {fault}: {error}"
        until = rospy.Time.now().to_sec() + length
        while rospy.Time.now().to_sec() < until:
            time.sleep(0.02)
        return what, None

    def disconnect(self, _, length):
        """The bridge loses the controller, and is refused."""
        begin = self.observer.rospy.Time.now().to_sec()
        self.graph.proxy.shut()
        self.at_rest(begin, time.monotonic() + length)
        self.graph.proxy.listen()
        return f"{length:.1f} s", None

    def corrupt(self, node, length):
        """Replies of the controller are invalid, or a node's ports get invalid bytes."""
        if self.random.random() < 0.5:
            what = self.random.choice(list(REPLIES))
            self.graph.proxy.down = REPLIES[what]
            time.sleep(length)
            self.graph.proxy.calm()
            return "reply: " + what, None
        intruders = []
        for port in self.observer.ports_of(node) * INTRUDERS:
            intruders.append(socket.create_connection(("127.0.0.1", port), 5.0))
            try:
                intruders[-1].sendall(self.random.randbytes(self.random.randint(1, 65536)))
            except OSError:  # the node has closed it
                pass
        time.sleep(length)
        for intruder in intruders:
            intruder.close()
        return "ports of " + node, None

    def fill(self, _, length):
        """No byte can be added to database, logs and motion log."""
        self.graph.disk.fill()
        time.sleep(length)
        self.graph.disk.clear()
        return f"{length:.1f} s", None

    def at_rest(self, begin, end):
        """Until @p end (wall): nothing may move from @p begin + STANDSTILL (simulated) on, as the controller itself reports."""
        rospy = self.observer.rospy
        while time.monotonic() < end and rospy.Time.now().to_sec() < begin + STANDSTILL:
            time.sleep(0.02)
        if time.monotonic() < end:
            session = focas_wire.Observer(self.graph.controller)
            before = session.read()
            time.sleep(max(0.05, end - time.monotonic()))
            after = session.read()
            session.close()
            if before[:3] != after[:3] or before[3] != 0.0:
                self.observer.violate(f"motion without a connection: position {before[:3]} then {after[:3]} mm, spindle {before[3]:.0f} rpm")


def run(seed, arguments):
    """One run. @return its figures"""
    folder = pathlib.Path(tempfile.mkdtemp(prefix=f"chaos_{seed}_"))
    graph, parts = Graph(folder, arguments.pace, faults=not arguments.without_faults), Parts(folder / "run.bag")
    result = {"seed": seed, "faults": [], "recovery": [], "violations": []}
    try:
        observer = Observer()
        began = time.monotonic()
        while observer.missing() and time.monotonic() - began < 90:
            observer.produce()
            time.sleep(0.05)
        if observer.missing():
            errors = [line for line in (folder / "log.txt").read_text(errors="replace").splitlines() if line.startswith("ERROR")]
            raise RuntimeError("; ".join(["the graph does not start: " + ", ".join(observer.missing()), *errors[:1]]))
        faults = Faults(seed, observer, graph)
        begin, first_stamp = time.monotonic(), observer.rospy.Time.now().to_sec()
        stamps, pending, is_over, pause = [], None, None, faults.random.expovariate(1.0 / MEAN_PAUSE)
        while time.monotonic() - begin < arguments.seconds or (pending and time.monotonic() - pending < RECOVERY):
            if graph.launch.poll() is not None:
                raise RuntimeError("the graph has ended")
            observer.produce()
            parts.collect(stamps)
            lacks = observer.missing()
            if pending:
                if not lacks and is_over() and observer.served_since(pending):
                    result["recovery"].append(round(time.monotonic() - pending, 2))
                    result["faults"][-1].append(result["recovery"][-1])
                    pending, pause = None, faults.random.expovariate(1.0 / MEAN_PAUSE)
                    stamps[-1][1] = observer.rospy.Time.now().to_sec()
                    since = time.monotonic()
                elif time.monotonic() - pending > RECOVERY:
                    observer.violate(f"no full service within {RECOVERY:.0f} s: after {result['faults'][-1][:2]} lacks {', '.join(lacks) or 'the restart of the node'}")
                    break
            elif arguments.without_faults:
                pass
            elif time.monotonic() - (since if result["faults"] else begin) > pause and time.monotonic() - begin < arguments.seconds:
                from_stamp = observer.rospy.Time.now().to_sec()
                kind, what, pending, is_over = faults.make()
                stamps.append([from_stamp - 0.1, math.inf, kind, what])
                result["faults"].append([kind, what])
            time.sleep(0.05)
        result["simulated"] = round(observer.rospy.Time.now().to_sec() - first_stamp, 1)
        result["slots"] = observer.finished
        result["violations"] += observer.violations
        result["restarts"] = {name.split("/")[-1]: m.starts - 1 for name, m in observer.health.items() if m.starts > 1}
        result["series"] = observer.series
        cuts = observer.cuts
    except RuntimeError as error:
        result["violations"].append(str(error))
        stamps, cuts = [], []
    finally:
        graph.end()
    lost, result["samples"], result["wrong"], result["judged"] = parts.finish(stamps)
    result["violations"] += [f"lost: {line}" for line in lost[:3]]
    if result["wrong"]:
        result["violations"].append(f"{result['wrong']} of {result['judged']} blocks of compensated force are wrong and not marked")
    if not result["samples"]:
        result["violations"].append("no recording")
    database = graph.disk.folder / "machine.sqlite"
    if database.exists():
        wrong, result["records"] = unstored(database, cuts, stamps)
        result["violations"] += wrong[:3]
    if result["violations"] and arguments.out:
        shutil.copytree(folder, pathlib.Path(arguments.out) / f"seed_{seed}", dirs_exist_ok=True)
    graph.disk.end()
    shutil.rmtree(folder, ignore_errors=True)
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--pace", type=float, default=3.0)
    parser.add_argument("--without-faults", action="store_true")
    parser.add_argument("--out")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:  # rospy starts once in a process
        print(json.dumps(run(arguments.first, arguments)))
        return 0
    if arguments.out:
        pathlib.Path(arguments.out).mkdir(parents=True, exist_ok=True)
    own_mounts = ["unshare", *([] if os.getuid() == 0 else ["--map-root-user"]), "--mount"]
    if shutil.which("unshare") is None or subprocess.run([*own_mounts, "true"], capture_output=True).returncode != 0:
        own_mounts = []
        print("the disk is never full: this process may not mount a file system")
    os.environ[OWN_MOUNTS] = "1" if own_mounts else "0"
    results = []
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        command = [*own_mounts, sys.executable, __file__, "--one", "--first", str(seed), "--seconds", str(arguments.seconds), "--pace", str(arguments.pace)]
        command += ["--without-faults"] if arguments.without_faults else []
        command += ["--out", arguments.out] if arguments.out else []
        done = subprocess.run(command, capture_output=True, text=True)
        lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
        result = json.loads(lines[-1]) if lines else {"seed": seed, "faults": [], "recovery": [], "violations": ["observer ended: " + done.stderr[-400:]]}
        series = result.pop("series", {})
        results.append(result)
        if arguments.out:
            with open(pathlib.Path(arguments.out) / "runs.jsonl", "a") as file:
                file.write(json.dumps(result) + "\n")
        print(f"seed {seed}: {len(result['faults'])} faults, recovery at most {max(result['recovery'], default=0):.1f} s, {result.get('simulated', 0):.0f} s simulated, "
              f"{result.get('slots', 0)} slots, {result.get('records', 0)} records of cuts, {result.get('samples', 0)} samples, {result.get('wrong', 0)} of {result.get('judged', 0)} blocks wrong; "
              + ("; ".join(result["violations"]) or "no rule violated"), flush=True)
        if arguments.without_faults:
            print("\n".join(growth(series)), flush=True)
            if arguments.out and series:
                draw(series, pathlib.Path(arguments.out) / f"nodes_{seed}.png")
    recovery = [value for result in results for value in result["recovery"]]
    kinds = {kind: sum(fault[0] == kind for result in results for fault in result["faults"]) for kind in KINDS}
    violated = sum(bool(result["violations"]) for result in results)
    print(f"{len(results)} runs, {sum(r.get('simulated', 0) for r in results) / 3600:.2f} h simulated, "
          + ", ".join(f"{count} x {kind}" for kind, count in kinds.items()) + f", {sum(r.get('samples', 0) for r in results)} samples of forces")
    if recovery:
        print(f"recovery of {len(recovery)} faults: median {statistics.median(recovery):.1f} s, 99 % {percentile(recovery, 0.99):.1f} s, longest {max(recovery):.1f} s")
    print(f"{violated} of {len(results)} runs violated a rule")
    return 1 if violated else 0


if __name__ == "__main__":
    sys.exit(main())
