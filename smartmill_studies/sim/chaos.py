#!/usr/bin/env python3
"""Production on the simulated machine while processes are killed, stopped and starved, sensors are faulty, the controller is disconnected,
replies and ports get invalid bytes and the disk is full, at random; an observer checks what must hold.

usage: devel/env.sh smartmill_studies/sim/chaos.py [--seeds N] [--first S] [--seconds T] [--pace P] [--without-faults] [--out FOLDER]
                                                                                              (in the repository's folder)
--seeds: number of runs, each with the next seed from --first on. --seconds: wall time of a run, without its start and end. --pace:
simulated time per wall time. --without-faults: production alone; memory, descriptors, threads and latency of the nodes are compared from
the second minute on. --out: folder for the recording and log of each run that violates a rule, and for runs.jsonl.

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
import re
import shutil
import signal
import socket
import sqlite3
import statistics
import subprocess
import sys
import tempfile
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "cnc"))
import focas_wire  # noqa: E402
from ros_processes import ROOT, free_port  # noqa: E402

NODES = ("cnc", "frames", "hammer", "kalman", "loadmeter", "stability")
STREAMS = ("daq/dynamometer", "spindle/angle")
# With the words of StreamCheck's table: faults that the stream alone shows. A wrong scale, sign or order does not.
SENSOR_FAULTS = ("off", "stuck", "garbage", "delayed", "intermittent", "duplicated", "clock_step", "slow")
KINDS = ("kill", "stop", "starve", "sensor", "disconnect", "corrupt", "fill")
REPLIES = {"version 0": focas_wire.spoiled(focas_wire.set_at(5, 0)), "a length beyond the frame": focas_wire.spoiled(focas_wire.set_at(12, 0xFF)),
           "another request's reply": focas_wire.spoiled(focas_wire.wrong_opcode), "no frame": focas_wire.spoiled(focas_wire.set_at(1, 0)),
           "half a frame": lambda frame: (frame[:11],), "none": lambda frame: b"", "10,000 foreign bytes before it": focas_wire.flood}
DISK_MB = 64            # file system of database and logs
INTRUDERS = 8           # connections with invalid bytes to each port of a node
STANDSTILL = 2.0        # [s] simulated, after motion was disarmed or the controller was lost
SILENT = 2.5            # [s] wall, of a node that reports once a second
ABANDON = 2.0           # [s] wall, after which a goal whose program does not run is given up
RECOVERY = 30.0         # [s] wall, in which the graph must be in full service again
MEAN_PAUSE = 4.0        # [s] wall, between full service and the next fault
WRONG = 0.5             # [1] error of a block's RMS over that of the true force from which it is wrong
LEAST_FORCE = 20.0      # [N] RMS of a block that is judged
STEADY = 0.3            # [1] range of the RMS of five blocks in a steady cut
AFTER = 2.0             # [s] simulated after a fault, in which its consequences end
OWN_MOUNTS = "SMARTMILL_OWN_MOUNTS"  # set to 1: this process may mount file systems that others do not see
COMPENSATED, PASSED_THROUGH, TRANSIENT = 1, 2, 4  # ForceBlock.status
STEADY_PATH = 0.13      # [m] to both sides of the middle of the stock
LIMITS = {"X": 0.25, "Y": 0.2, "Z": 0.3}  # [m] travel of launch/models/mill.yaml, to both sides; Z to 0


def slot(number, kind):
    """NC program and condition of one slot in the stock of mill_twin.yaml, nine lanes on each level, each 1 mm deep, or of an air cut above it"""
    from smartmill_msgs.msg import CuttingCondition
    lane, level = number % 9, number // 9
    y, z = -80 + 20 * lane, -150 if kind == CuttingCondition.AIR else -161 - level
    feed_per_tooth = (1e-4, 7.5e-5)[number % 2]
    program = "\n".join(("G90 G0 Z-150.", f"G0 X-152. Y{y}.", "S4000 M3", "G4 X1.", f"G0 Z{z}.", f"G1 X152. F{feed_per_tooth * 4 * 4000 * 1e3:.0f}.",
                         "G0 Z-150.", "M30", ""))
    name = ("air cut " if kind == CuttingCondition.AIR else "slot ") + str(number)
    condition = CuttingCondition(kind=kind, name=name, material="al7050", tool="end_mill", teeth=4, diameter=0.01905, helix=math.radians(30.0),
                                 spindle_speed=4000 * math.pi / 30, feed_per_tooth=feed_per_tooth, axial_depth=1e-3, entry_angle=0.0, exit_angle=math.pi)
    for point, x in ((condition.steady_from, -STEADY_PATH), (condition.steady_to, STEADY_PATH)):
        point.x, point.y, point.z = x, 1e-3 * y, 1e-3 * z
    return program, condition


class Disk:
    """File system of database, logs and motion log, which can be filled where this process may mount one."""

    def __init__(self, folder):
        self.folder = folder
        folder.mkdir()
        mount = ["mount", "-t", "tmpfs", "-o", f"size={DISK_MB}m", "none", str(folder)]
        self.mounted = os.environ.get(OWN_MOUNTS) == "1" and subprocess.run(mount, capture_output=True).returncode == 0

    def fill(self):
        with open(self.folder / "filling", "wb", buffering=0) as file:
            try:
                while True:
                    file.write(bytes(1 << 20))
            except OSError:
                pass

    def clear(self):
        (self.folder / "filling").unlink()

    def end(self):
        if self.mounted:
            subprocess.run(["umount", "--lazy", str(self.folder)], check=True)


class Graph:
    """The pipeline in a process group of its own."""

    def __init__(self, folder, pace, port=None):
        """@param port of a master that runs; None: roslaunch starts one"""
        self.folder = folder
        self.disk = Disk(folder / "disk")
        self.controller = free_port()
        self.proxy = focas_wire.Proxy(self.controller)
        self.master = f"http://localhost:{port or free_port()}"
        os.environ.update(ROS_MASTER_URI=self.master, ROS_HOSTNAME="localhost", ROS_HOME=str(self.disk.folder / "home"))
        arguments = ["smartmill_launch", "pipeline.launch", f"pace:={pace}", f"machine:={ROOT / 'launch/models/mill_twin.yaml'}", f"port:={self.controller}",
                     f"bridge_port:={self.proxy.port}", f"bag:={folder / 'run.bag'}", f"database:={self.disk.folder / 'machine.sqlite'}", "faults:=true",
                     f"fault_topics:={' '.join(STREAMS)}", f"motion_log:={self.disk.folder / 'motion.log'}"]
        self.log = open(folder / "log.txt", "wb")
        self.launch = subprocess.Popen(["roslaunch", "-p", self.master.rsplit(":", 1)[1], *arguments], stdout=self.log, stderr=subprocess.STDOUT,
                                       start_new_session=True)

    def end(self):
        self.launch.send_signal(signal.SIGINT)
        try:
            self.launch.wait(60)
        except subprocess.TimeoutExpired:
            os.killpg(self.launch.pid, signal.SIGKILL)
        self.log.close()


def await_master():
    """The nodes take their time from /clock once its parameter is set."""
    import rosgraph
    end = time.monotonic() + 60
    while time.monotonic() < end:
        try:
            if rosgraph.Master("/observer").hasParam("/use_sim_time"):
                return
        except (OSError, rosgraph.MasterException):
            pass
        time.sleep(0.1)
    raise RuntimeError("no master within 60 s")


class Observer:
    """Client of the graph that mills slots and notes what the nodes state. Times are wall times unless they are stamps."""

    def __init__(self):
        import actionlib
        import rospy
        from smartmill_msgs.msg import ChatterState, CncState, NodeHealth, RunProgramAction
        from smartmill_msgs.srv import ArmMotion, SetFault
        self.rospy, self.lock, self.violations = rospy, threading.Lock(), []
        await_master()
        rospy.init_node("observer", disable_signals=True)
        self.heard, self.health, self.series = {}, {}, {}
        self.state, self.disarmed_since, self.force_status, self.force_at = None, None, None, 0.0
        self.finished, self.sent_at, self.ran_at = 0, None, 0.0
        self.sent = None          # what was sent: kind, number of the slot, starts of loadmeter, stamp
        self.air_known_to = None  # starts of loadmeter that has measured an air cut
        self.first_of = {}        # number of each slot that was sent: stamp at its first time
        self.cuts = []            # finished slots, milled without interruption, of which loadmeter makes a record: stamps of begin and end
        self.client = actionlib.SimpleActionClient("/smartmill/cnc/run_program", RunProgramAction)
        self.arm_service = rospy.ServiceProxy("/smartmill/cnc/arm_motion", ArmMotion)
        self.fault_service = rospy.ServiceProxy("/smartmill/sim/set_fault", SetFault)
        rospy.Subscriber("/smartmill/cnc/state", CncState, self.take_state, queue_size=1000)
        rospy.Subscriber("/smartmill/health", NodeHealth, self.take_health, queue_size=1000)
        rospy.Subscriber("/smartmill/force/compensated", rospy.AnyMsg, self.take_force, queue_size=1000)

    def violate(self, text):
        if text.split(":")[0] not in {v.split(":")[0] for v in self.violations}:
            self.violations.append(text)

    def take_state(self, m):
        with self.lock:
            stamp = m.header.stamp.to_sec()
            self.state, self.heard["state"] = m, time.monotonic()
            if not m.connected:
                return
            for name, value in zip(m.axes, m.position):
                limit = LIMITS.get(name)
                if limit is not None and not (-limit - 1e-6 <= value <= (0.0 if name == "Z" else limit) + 1e-6):
                    self.violate(f"position beyond the limits: {name} {value:.6f} m at {stamp:.3f} s")
            if m.armed:
                self.disarmed_since = None
                return
            self.disarmed_since = self.disarmed_since or stamp
            if stamp > self.disarmed_since + STANDSTILL and (m.feed > 1e-6 or m.spindle_speed > 1.0):
                self.violate(f"motion while disarmed: feed {m.feed:.4f} m/s, spindle {m.spindle_speed:.1f} rad/s {stamp - self.disarmed_since:.1f} s later")

    def take_health(self, m):
        with self.lock:
            self.health[m.node] = m
            self.heard[m.node] = time.monotonic()
            latency = max([i.latency for i in m.inputs], default=0.0)
            self.series.setdefault(m.node, []).append((time.monotonic(), m.memory, m.descriptors, m.threads, latency, m.cpu))

    def take_force(self, m):
        self.force_status, self.force_at = m._buff[-1], time.monotonic()

    def missing(self):
        """What lacks to full service; empty: nothing."""
        now, lacks = time.monotonic(), []
        with self.lock:
            for node in NODES:
                if node != "frames" and now - self.heard.get("/smartmill/" + node, -math.inf) > SILENT:
                    lacks.append(node)
            if now - self.heard.get("state", -math.inf) > 1.0 or not self.state.connected:
                lacks.append("state of the controller")
            elif not self.state.armed or self.state.run != 3:
                lacks.append("a running program")
            if now - self.force_at > 1.0 or self.force_status not in (COMPENSATED, PASSED_THROUGH, TRANSIENT):
                lacks.append("compensated forces")
        return lacks

    def served_since(self, time_of_end):
        """Whether all nodes have reported, and controller and forces are current, since then."""
        with self.lock:
            heard = [self.heard.get("/smartmill/" + node, -math.inf) for node in NODES if node != "frames"]
            return min(*heard, self.heard.get("state", -math.inf), self.force_at) > time_of_end

    def produce(self):
        """Arms and sends the next slot, or the air cut that loadmeter needs, when none runs."""
        from smartmill_msgs.msg import CuttingCondition, RunProgramGoal
        state = self.state
        if state is None or not state.connected or time.monotonic() - self.heard["state"] > 1.0:
            return
        if self.sent_at is not None and self.client.get_state() in (0, 1):
            # Goals of a bridge that was killed never end; those of one that runs end after the program.
            if state.run == 3:
                self.ran_at = time.monotonic()
            if time.monotonic() - max(self.sent_at, self.ran_at) < ABANDON:
                return
            self.client.stop_tracking_goal()
        elif self.sent_at is not None and self.client.get_state() == 3:
            self.finish(state.header.stamp.to_sec())
        self.sent_at = None
        if state.run == 3 and state.armed:
            return
        # The machine must be at rest before it is armed again, so that the rule is tested.
        stamp = state.header.stamp.to_sec()
        if not state.armed and stamp < (self.disarmed_since or stamp) + STANDSTILL + 0.5:
            return
        try:
            if not state.armed:
                if self.arm_service(arm=True, client="").code != 0:
                    return
            if not self.client.wait_for_server(self.rospy.Duration(0.01)):
                return
        except self.rospy.ServiceException:
            return
        now = self.rospy.Time.now()
        starts = self.starts_of("loadmeter")
        kind = CuttingCondition.CUT if starts == self.air_known_to else CuttingCondition.AIR
        # A slot that was not finished is milled again: the next level must not be twice as deep, which would chatter. As a part of it is cut, it has
        # no steady part.
        program, condition = slot(self.finished, kind)
        if kind == CuttingCondition.CUT and self.finished in self.first_of:
            condition.steady_to = condition.steady_from
        goal = RunProgramGoal(name=condition.name, program=program, condition=condition)
        goal.header.stamp = goal.condition.header.stamp = now
        self.sent, self.sent_at = (kind, self.finished, starts, now.to_sec()), time.monotonic()
        self.first_of.setdefault(self.finished if kind == CuttingCondition.CUT else None, now.to_sec())
        self.client.send_goal(goal)

    def finish(self, stamp):
        """The program that was sent has ended."""
        from smartmill_msgs.msg import CuttingCondition
        kind, number, starts, begin = self.sent
        if kind == CuttingCondition.AIR:
            self.air_known_to = starts
            return
        self.finished += 1
        if self.first_of[number] == begin and starts == self.starts_of("loadmeter"):
            self.cuts.append((begin, stamp))

    def starts_of(self, node):
        """Of a node; frames, which reports no health, by its process."""
        if node == "frames":
            return self.process_of(node)
        health = self.health.get("/smartmill/" + node)
        return health.starts if health else 0

    def process_of(self, node):
        import rosgraph
        from xmlrpc.client import ServerProxy
        try:
            uri = rosgraph.Master("/observer").lookupNode("/smartmill/" + node if node != "frames" else "/frames")
            return ServerProxy(uri).getPid("/observer")[2]
        except Exception:
            return None

    def ports_of(self, node):
        """Of its XML-RPC server and of its topics; empty: the node is not there"""
        import rosgraph
        from xmlrpc.client import ServerProxy
        try:
            uri = rosgraph.Master("/observer").lookupNode("/smartmill/" + node if node != "frames" else "/frames")
            topics = ServerProxy(uri).requestTopic("/observer", "/rosout", [["TCPROS"]])
            return [int(uri.rstrip("/").rsplit(":", 1)[1]), int(topics[2][2])]
        except Exception:
            return []


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
        busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2 * os.cpu_count())]
        time.sleep(length)
        for process in busy:
            process.kill()
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


def force_blocks(bag):
    """@return {first_index: (stamp, status, RMS [N], forces)} of force/compensated and sim/truth/force"""
    import struct
    import numpy
    import rosbag
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
    import numpy
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
    """@return what is wrong with the records of the cuts; number of records that had to be there. Cuts without states of the controller have none."""
    with sqlite3.connect(database) as connection:
        whole = connection.execute("PRAGMA integrity_check").fetchone()[0]
        if whole != "ok":
            return ["database: " + whole], 0
        records = [stamp for (stamp,) in connection.execute("SELECT stamp FROM coefficients")]
    wrong, owed = [], 0
    for begin, end in cuts:
        if any((kind in ("disconnect", "corrupt") or what == "cnc") and start < end + AFTER and until > begin - AFTER for start, until, kind, what in faults):
            continue
        owed += 1
        number = sum(begin <= stamp <= end for stamp in records)
        if number != 1:
            wrong.append(f"database: {number} records of the cut from {begin:.1f} to {end:.1f} s, expected 1")
    return wrong, owed


def account_of(bag):
    """@return lost between publishers and recorder or nodes, lines of the account, starts of each node"""
    done = subprocess.run(["smartmill", "account", str(bag)], capture_output=True, text=True)
    lines = done.stdout.splitlines()
    lost = [line for line in lines if "lost between publisher" in line]
    if done.returncode not in (0, 3):
        lost.append(done.stderr.strip())
    nodes = [line.split() for line in lines if re.match(r"/smartmill/\w+ +\d+ +\d+ +\d+ +\d+ +\d+$", line)]
    lost += [f"{words[0]} lost {words[3]} messages" for words in nodes if int(words[3]) > 0]
    return lost, lines, [words[1] for words in nodes]


def run(seed, arguments):
    """One run. @return its figures"""
    folder = pathlib.Path(tempfile.mkdtemp(prefix=f"chaos_{seed}_"))
    graph = Graph(folder, arguments.pace)
    result = {"seed": seed, "faults": [], "recovery": [], "violations": []}
    try:
        observer = Observer()
        began = time.monotonic()
        while observer.missing() and time.monotonic() - began < 90:
            observer.produce()
            time.sleep(0.05)
        if observer.missing():
            raise RuntimeError("the graph does not start: " + ", ".join(observer.missing()))
        faults = Faults(seed, observer, graph)
        begin, first_stamp = time.monotonic(), observer.rospy.Time.now().to_sec()
        stamps, pending, pause = [], None, faults.random.expovariate(1.0 / MEAN_PAUSE)
        while time.monotonic() - begin < arguments.seconds or (pending and time.monotonic() - pending < RECOVERY):
            if graph.launch.poll() is not None:
                raise RuntimeError("the graph has ended")
            observer.produce()
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
    bag = folder / "run.bag"
    if bag.exists():
        lost, lines, _ = account_of(bag)
        result["violations"] += [f"lost: {line}" for line in lost[:3]]
        result["samples"] = sum(int(words[3]) for words in (line.split() for line in lines) if len(words) > 8 and words[0] == "/smartmill/daq/dynamometer")
        wrong, judged = unmarked(bag, stamps)
        result["wrong"], result["judged"] = wrong, judged
        if wrong:
            result["violations"].append(f"{wrong} of {judged} blocks of compensated force are wrong and not marked")
    else:
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


def percentile(values, share):
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, math.ceil(share * len(ordered)) - 1)]


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
