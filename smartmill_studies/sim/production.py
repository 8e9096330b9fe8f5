"""The pipeline on the simulated machine, and a client of it that mills slots and notes what the nodes state."""
import math
import os
import pathlib
import signal
import subprocess
import sys
import threading
import time
from xmlrpc.client import ServerProxy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "cnc"))
import focas_wire  # noqa: E402
from ros_processes import ROOT, free_port  # noqa: E402

NODES = ("cnc", "frames", "hammer", "kalman", "loadmeter", "stability")
STREAMS = ("daq/dynamometer", "spindle/angle")
STANDSTILL = 2.0        # [s] simulated, after motion was disarmed or the controller was lost
SILENT = 2.5            # [s] wall, of a node that reports once a second
ABANDON = 2.0           # [s] wall, after which a goal whose program does not run is given up
COMPENSATED, PASSED_THROUGH, TRANSIENT = 1, 2, 4  # ForceBlock.status
LIMITS = {"X": 0.25, "Y": 0.2, "Z": 0.3}  # [m] travel of launch/models/mill.yaml, to both sides; Z to 0
LANES, LEVELS = 9, 39   # of slots in the stock of mill_twin.yaml
STEADY_PATH = 0.13      # [m] to both sides of the middle of the stock
DISK_MB = 256           # file system of database and logs
OWN_MOUNTS = "SMARTMILL_OWN_MOUNTS"  # set to 1: this process may mount file systems that others do not see


def slot(number, kind):
    """NC program and condition of one slot in the stock, 1 mm deep, or of an air cut above it"""
    from smartmill_msgs.msg import CuttingCondition
    lane, level = number % LANES, number // LANES % LEVELS
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

    def __init__(self, folder, pace, port=None, faults=True):
        """@param port of a master that runs; None: roslaunch starts one. @param faults whether the streams pass through fault_node"""
        self.folder = folder
        self.disk = Disk(folder / "disk")
        self.controller = free_port()
        self.proxy = focas_wire.Proxy(self.controller)
        self.master = f"http://localhost:{port or free_port()}"
        os.environ.update(ROS_MASTER_URI=self.master, ROS_HOSTNAME="localhost", ROS_HOME=str(self.disk.folder / "home"))
        arguments = ["smartmill_launch", "pipeline.launch", f"pace:={pace}", f"machine:={ROOT / 'launch/models/mill_twin.yaml'}", f"port:={self.controller}",
                     f"bridge_port:={self.proxy.port}", f"bag:={folder / 'run.bag'}", f"database:={self.disk.folder / 'machine.sqlite'}",
                     f"faults:={str(faults).lower()}", f"fault_topics:={' '.join(STREAMS)}", f"motion_log:={self.disk.folder / 'motion.log'}"]
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
        from smartmill_msgs.msg import CncState, NodeHealth, RunProgramAction
        from smartmill_msgs.srv import ArmMotion, PanelKey, SetFault
        self.rospy, self.lock, self.violations = rospy, threading.Lock(), []
        await_master()
        rospy.init_node("observer", disable_signals=True)
        self.heard, self.health, self.series = {}, {}, {}
        self.state, self.disarmed_since, self.force_status, self.force_at = None, None, None, 0.0
        self.finished, self.workpieces, self.sent_at, self.ran_at = 0, 1, None, 0.0
        self.sent = None          # what was sent: kind, whether it is a slot's first time, starts of loadmeter, stamp
        self.air_known_to = None  # starts of loadmeter that has measured an air cut
        self.begun = 0            # slots that were sent once or more
        self.cuts = []            # finished slots, milled without interruption, of which loadmeter makes a record: stamps of begin and end
        self.client = actionlib.SimpleActionClient("/smartmill/cnc/run_program", RunProgramAction)
        self.arm_service = rospy.ServiceProxy("/smartmill/cnc/arm_motion", ArmMotion)
        self.workpiece_service = rospy.ServiceProxy("/smartmill/sim/panel/new_workpiece", PanelKey)
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
            if self.finished // (LANES * LEVELS) == self.workpieces:
                if self.workpiece_service(values=[], text="").code != 0:  # the spindle still turns
                    return
                self.workpieces += 1
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
        first = kind == CuttingCondition.CUT and self.finished == self.begun
        self.begun += first
        if kind == CuttingCondition.CUT and not first:
            condition.steady_to = condition.steady_from
        goal = RunProgramGoal(name=condition.name, program=program, condition=condition)
        goal.header.stamp = goal.condition.header.stamp = now
        self.sent, self.sent_at = (kind, first, starts, now.to_sec()), time.monotonic()
        self.client.send_goal(goal)

    def finish(self, stamp):
        """The program that was sent has ended."""
        from smartmill_msgs.msg import CuttingCondition
        kind, first, starts, begin = self.sent
        if kind == CuttingCondition.AIR:
            self.air_known_to = starts
            return
        self.finished += 1
        if first and starts == self.starts_of("loadmeter"):
            self.cuts.append((begin, stamp))

    def starts_of(self, node):
        """Of a node; frames, which reports no health, by its process."""
        if node == "frames":
            return self.process_of(node)
        health = self.health.get("/smartmill/" + node)
        return health.starts if health else 0

    @staticmethod
    def uri_of(node):
        import rosgraph
        return rosgraph.Master("/observer").lookupNode("/smartmill/" + node if node != "frames" else "/frames")

    def process_of(self, node):
        try:
            return ServerProxy(self.uri_of(node)).getPid("/observer")[2]
        except Exception:
            return None

    def ports_of(self, node):
        """Of its XML-RPC server and of its topics; empty: the node is not there"""
        try:
            uri = self.uri_of(node)
            topics = ServerProxy(uri).requestTopic("/observer", "/rosout", [["TCPROS"]])
            return [int(uri.rstrip("/").rsplit(":", 1)[1]), int(topics[2][2])]
        except Exception:
            return []
