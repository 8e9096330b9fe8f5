#!/usr/bin/env python3
"""What can go wrong between the bridge and a Fanuc, with the real processes: sim_node (the controller), cnc_node (the bridge) and,
with --hammer, hammer_node under a ROS master of their own; between bridge and controller stands a proxy that does the harm. A
second session of FOCAS, written here from the wire's description, looks at the controller itself for what moved.

usage: devel/env.sh smartmill_studies/cnc/node_faults.py [--hammer] [--only WORD] [--out FILE]   (in the repository's folder)
--hammer: the controller killed (SIGKILL) and started anew at each step of the hammer's measurement, in the place of the others.
Prints a table: fault, what the goal answers, what the diagnostics say, what moved. Exit code 1: a row is not as it has to be.
"""
import argparse
import os
import pathlib
import re
import signal
import socket
import struct
import sys
import tempfile
import threading
import time

from ros_house import PATIENCE, ROOT, House, free_port, until

MAGIC = b"\xa0" * 4
ERROR, DATA, DNC_START = 3, 0x21, 0x19
BRAKED = 0.4  # [s] a motion that has been taken away may take to stand
WATCH = 1.2  # [s] nothing may move for


def frame_of(kind, direction, body, version=1):
    return MAGIC + struct.pack(">HBBH", version, kind, direction, len(body)) + body


def close_down(end):
    try:
        end.shutdown(socket.SHUT_RDWR)
    except OSError:
        pass


class Wire:
    """Frames of one connection."""

    def __init__(self, connection):
        self.socket, self.rest, self.waiting = connection, b"", []

    def frames(self):
        """Those that have come whole. @raises ConnectionError at the end."""
        data = self.socket.recv(65536)
        if not data:
            raise ConnectionError("closed")
        self.rest += data
        whole = []
        while len(self.rest) >= 10:
            size = 10 + struct.unpack(">H", self.rest[8:10])[0]
            if len(self.rest) < size:
                break
            whole.append(self.rest[:size])
            self.rest = self.rest[size:]
        return whole


class Observer:
    """A session of its own: positions, spindle, state, as the controller tells them."""

    def __init__(self, port):
        self.wires = []
        for circuit in (1, 2):
            wire = Wire(socket.create_connection(("127.0.0.1", port), PATIENCE))
            wire.socket.sendall(frame_of(1, 1, struct.pack(">H", circuit)))
            self.wires.append(wire)
            if self.receive(wire)[7] == ERROR:
                self.close()
                raise ConnectionError("refused")

    @staticmethod
    def receive(wire):
        while not wire.waiting:
            wire.waiting += wire.frames()
        return wire.waiting.pop(0)

    def ask(self, opcode, *values):
        values = (list(values) + [0] * 5)[:5]
        self.wires[1].socket.sendall(frame_of(DATA, 1, struct.pack(">HHHHH5i", 1, 0x1C, 1, 1, opcode, *values)))
        body = self.receive(self.wires[1])[10:]
        return body[18:]

    def look(self):
        """(x, y, z [mm], spindle [rpm], run, blocks)"""
        position, speed = self.ask(0x26, 1, -1), self.ask(0x25)
        values = [struct.unpack(">iHh", (position + speed)[8 * i:8 * i + 8]) for i in range(4)]
        run = struct.unpack(">7h", self.ask(0x19)[:14])[1]
        return [value / base**exponent for value, base, exponent in values] + [run, struct.unpack(">i", self.ask(0x35))[0]]

    def close(self):
        for wire in self.wires:
            wire.socket.close()


class Proxy:
    """Hands frames on, or does to them what `down` (controller to bridge) or `up` says: gives the bytes to send, None: hang up."""

    def __init__(self, target):
        self.target, self.port, self.ends = target, free_port(), []
        self.calm()
        self.listen()

    def listen(self):
        self.listener = socket.create_server(("127.0.0.1", self.port))
        threading.Thread(target=self.accept, args=(self.listener,), daemon=True).start()

    def shut(self):
        """As a server that has gone: connections end, further ones are refused."""
        for end in (self.listener, *self.ends):
            close_down(end)
        self.listener.close()
        self.ends = []

    def calm(self):
        self.down = self.up = lambda frame: frame
        self.byte_by_byte = False

    def accept(self, listener):
        while True:
            try:
                client, _ = listener.accept()
            except OSError:
                return
            try:
                server = socket.create_connection(("127.0.0.1", self.target), 5)
            except OSError:
                client.close()
                continue
            for end in (client, server):
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                end.settimeout(None)
                self.ends.append(end)
            for source, sink, way in ((client, server, "up"), (server, client, "down")):
                threading.Thread(target=self.serve, args=(source, sink, way), daemon=True).start()

    def serve(self, source, sink, way):
        wire = Wire(source)
        try:
            while True:
                for frame in wire.frames():
                    data = getattr(self, way)(frame)
                    hang_up = isinstance(data, tuple)
                    data = data[0] if hang_up else data
                    for piece in ([data[i:i + 1] for i in range(len(data))] if self.byte_by_byte else [data]):
                        sink.sendall(piece)
                    if hang_up:
                        raise ConnectionError("cut")
        except OSError:
            pass
        close_down(source)
        close_down(sink)


class Rig:
    """The house with a bridge that is connected through the proxy, and what it tells."""

    def __init__(self, folder, hammer):
        self.house, self.sim_port, self.rows, self.bad = House(folder), free_port(), [], 0
        self.proxy = Proxy(self.sim_port)
        rospy = self.rospy = self.house.rospy
        twin, believed = ROOT / "launch/models/mill_twin.yaml", ROOT / "launch/models/mill.yaml"
        rospy.set_param("/smartmill/sim", {"model": str(twin), "port": self.sim_port, "most_behind": 20.0, "substeps": 1})
        # Patient beyond the shipped 0.5 s where the fault is not silence: the computer may be slow.
        rospy.set_param("/smartmill/cnc", {"model": str(believed), "port": self.proxy.port, "read_only": False,
                                           "reconnect_period": 0.2, "reply_timeout": 2.0})
        rospy.set_param("/smartmill/hammer", {"model": str(believed), "command_machine": True})
        self.house.node("sim", "smartmill_sim", "sim_node")
        self.house.node("cnc", "smartmill_cnc", "cnc_node")
        if hammer:
            self.house.node("hammer", "smartmill_hammer", "hammer_node")
        self.listen()
        self.observer = None
        self.watch_anew()

    def listen(self):
        import actionlib
        from diagnostic_msgs.msg import DiagnosticArray
        from smartmill_msgs.msg import CncState, JogAction, MeasureFrfAction, RunProgramAction
        self.house.join("node_faults")
        self.state, self.diagnostic = CncState(), ""
        self.rospy.Subscriber("/smartmill/cnc/state", CncState, self.on_state)
        self.rospy.Subscriber("/diagnostics", DiagnosticArray, self.on_diagnostics)
        self.program = actionlib.SimpleActionClient("/smartmill/cnc/run_program", RunProgramAction)
        self.jog = actionlib.SimpleActionClient("/smartmill/cnc/jog", JogAction)
        self.measure = actionlib.SimpleActionClient("/smartmill/hammer/measure_frf", MeasureFrfAction)

    def on_state(self, state):
        self.state = state

    def on_diagnostics(self, array):
        for status in array.status:
            if status.name.endswith("controller"):
                self.diagnostic = ("OK", "WARN", "ERROR", "STALE")[status.level] + ": " + status.message

    # --- the operator

    def call(self, name, kind, **request):
        import smartmill_msgs.srv
        self.rospy.wait_for_service("/smartmill/" + name, PATIENCE)
        return self.rospy.ServiceProxy("/smartmill/" + name, getattr(smartmill_msgs.srv, kind))(**request)

    def panel(self, key, *values, text=""):
        return self.call("sim/panel/" + key, "PanelKey", values=list(values), text=text)

    def arm(self):
        if not self.state.connected or self.state.mode != 10:
            until(lambda: self.state.connected)
        if not self.state.connected:
            raise RuntimeError("the bridge does not connect: " + self.diagnostic)
        answer = self.call("cnc/arm_motion", "ArmMotion", arm=True)
        self.rospy.sleep(0.05)
        return answer

    def watch_anew(self):
        """A session of the observer's own, to the controller itself; waits for sim_node's mode key."""
        if self.observer:
            self.observer.close()
        self.observer = None

        def there():
            try:
                self.observer = Observer(self.sim_port)
            except OSError:
                return False
            return True
        if not until(there):
            raise RuntimeError("no controller: " + self.house.log("sim"))
        self.panel("mode", 10.0)

    def start_jog(self, axis="x", distance=0.08, feed=0.01):
        from smartmill_msgs.msg import JogGoal
        goal = JogGoal(axis=axis, distance=distance, feed=feed)
        if not self.jog.wait_for_server(self.rospy.Duration(PATIENCE)):
            raise RuntimeError("no bridge")
        self.jog.send_goal(goal)
        return self.jog

    def start_program(self, text, name="cut"):
        from smartmill_msgs.msg import RunProgramGoal
        goal = RunProgramGoal(name=name, program=text)
        goal.header.stamp = self.rospy.Time.now()
        if not self.program.wait_for_server(self.rospy.Duration(PATIENCE)):
            raise RuntimeError("no bridge")
        self.program.send_goal(goal)
        return self.program

    def moving(self):
        return until(lambda: self.state.motion)

    def result(self, client):
        # Not actionlib's own wait, which is of ROS time: a clock that jumps would end it.
        return client.get_result() if until(lambda: client.simple_state == 2) else None

    # --- what it comes to

    def told(self, pattern):
        """What the diagnostics say once they match."""
        until(lambda: re.search(pattern, self.diagnostic), 10.0)
        return self.diagnostic

    def stands(self):
        """[mm] that the machine moves after the time for braking, and whether nothing runs and the spindle stands."""
        time.sleep(BRAKED)
        before = self.observer.look()
        time.sleep(WATCH)
        after = self.observer.look()
        moved = max(abs(a - b) for a, b in zip(before[:3], after[:3]))
        return moved, after[3] == 0.0 and before[5] == after[5] and after[4] in (0, 1)

    def row(self, fault, result, codes, pattern, line_has="", stands=True, before=""):
        """One line of the table; result: code and message of the goal, or of what was refused; before: what they said first."""
        message = result.message if result else "no end"
        code = result.code if result else -1
        said = self.told(pattern)
        moved, quiet = self.stands() if stands else (0.0, True)
        good = code in codes and re.search(line_has, message) and "\n" not in message and re.search(pattern, said) and moved == 0.0 and quiet
        self.bad += not good
        verdict = ("nothing" if moved == 0.0 and quiet else f"{moved:.4f} mm, quiet: {quiet}") if stands else "the program, to its end"
        said = f"{before}; then {said}" if before else said
        self.rows.append(f"| {fault} | {message} | {said} | {verdict} |" + ("" if good else " <- NOT AS IT HAS TO BE"))
        print(self.rows[-1], flush=True)

    def recover(self):
        """As an operator does: calm wire, panel in order, connected, armed anew; a jog of 1 mm then has to work."""
        self.proxy.calm()
        self.panel("emergency_stop", 0.0)
        self.panel("reset")
        self.panel("mode", 10.0)
        until(lambda: self.state.connected and not self.state.alarm and not self.state.emergency and self.state.mode == 10)
        time.sleep(0.1)
        was_armed = self.state.armed
        if self.arm().code != 0:
            time.sleep(3.5)
            self.arm()
        after = self.result(self.start_jog("x", -0.001 if self.state.position[0] > 0.0 else 0.001, 0.02))
        if not after or after.code != 0:
            self.bad += 1
            print("   the next jog did not work: " + (after.message if after else "no end"), flush=True)
        return was_armed


    def retract(self):
        """The operator takes the tool away, upwards first."""
        self.arm()
        height = self.observer.look()[2]
        result = self.result(self.start_program(f"G91 G0 Z{-height:.3f}\n"))
        if not result or result.code != 0:
            self.bad += 1
            print("   not retracted: " + (result.message if result else "no end"), flush=True)


OK, CANCELLED, ALARM, LOST, NOT_ARMED = 0, 1, 6, 7, 3
CUT = "G91 G1 X20 F1200\nX-20\n"
LONG = "G91 G1 F6000\n" + "X0.5\nX-0.5\n" * 3000


def spoiled(change):
    def down(frame):
        if frame[6] != DATA:
            return frame
        wrong = bytearray(frame)
        change(wrong)
        return bytes(wrong)
    return down


def set_at(position, *values):
    def change(frame):
        frame[position:position + len(values)] = bytes(values)
    return change


def another_opcode(frame):
    frame[19] ^= 0x55


def in_mid_jog(rig, fault, harm, codes, pattern, line_has=""):
    rig.arm()
    client = rig.start_jog()
    rig.moving()
    rig.diagnostic = ""
    harm()
    rig.row(fault, rig.result(client), codes, pattern, line_has)
    if rig.state.armed:
        rig.bad += 1
        print("   still armed", flush=True)
    rig.recover()


def of_the_server(rig):
    rig.arm()
    client = rig.start_jog()
    rig.moving()
    rig.house.kill("sim")
    result = rig.result(client)
    said = rig.told("127.0.0.1.*trying again")
    rig.house.node("sim", "smartmill_sim", "sim_node")
    rig.watch_anew()
    until(lambda: rig.state.connected)
    rig.row("controller's process killed in mid-jog and started anew", result, {LOST}, "disarmed", "127.0.0.1", before=said)
    rig.recover()

    rig.arm()
    client = rig.start_jog()
    rig.moving()
    rig.house.kill("sim", signal.SIGSTOP)
    until(lambda: not rig.state.connected)
    said = rig.told("no answer in time")
    rig.house.kill("sim", signal.SIGCONT)
    rig.row("controller's process stopped (SIGSTOP) in mid-jog, then going on", rig.result(client), {LOST}, "disarmed",
            "no answer in time", before=said)
    rig.recover()


def of_the_bridge(rig):
    rig.arm()
    rig.start_jog()
    rig.moving()
    rig.house.kill("cnc")
    moved, quiet = rig.stands()
    rig.house.node("cnc", "smartmill_cnc", "cnc_node")
    rig.state.connected = False
    until(lambda: rig.state.connected)
    armed = rig.state.armed
    from smartmill_msgs.msg import JogGoal
    import actionlib
    from smartmill_msgs.msg import JogAction, RunProgramAction
    rig.jog = actionlib.SimpleActionClient("/smartmill/cnc/jog", JogAction)
    rig.program = actionlib.SimpleActionClient("/smartmill/cnc/run_program", RunProgramAction)
    rig.jog.wait_for_server(rig.rospy.Duration(PATIENCE))
    rig.jog.send_goal(JogGoal(axis="x", distance=0.001, feed=0.01))
    rig.row("bridge's process killed in mid-jog and started anew; a jog at once", rig.result(rig.jog), {NOT_ARMED}, "OK: .*disarmed")
    if moved or not quiet or armed:
        rig.bad += 1
        print(f"   moved {moved} mm, quiet {quiet}, armed {armed}", flush=True)
    rig.recover()


def of_the_wire(rig):
    cut = lambda frame: (frame[:11],) if frame[6] == DATA else frame
    in_mid_jog(rig, "connection cut in mid-frame, after 11 bytes of a reply", lambda: setattr(rig.proxy, "down", cut), {LOST},
               "closed it|DNC|127.0.0.1", "closed it")
    for what, change, told in (("version 0", set_at(5, 0), "reply with version 0"),
                               ("a length beyond the frame", set_at(12, 0xFF), "data end early"),
                               ("a length of nothing", set_at(12, 0, 0), "says it has 0 bytes"),
                               ("another opcode", another_opcode, "answers another request"),
                               ("fewer replies than asked", set_at(11, 1), "1 replies to"),
                               ("no frame at all", set_at(1, 0), "not a FOCAS frame")):
        in_mid_jog(rig, f"replies with {what}", lambda: setattr(rig.proxy, "down", spoiled(change)), {LOST}, told, told)
    silence = lambda frame: b""
    in_mid_jog(rig, "half-open: nothing comes back", lambda: setattr(rig.proxy, "down", silence), {LOST}, "no answer in time",
               "no answer in time")
    rig.arm()
    client = rig.start_program(CUT)
    rig.moving()
    nonsense = socket.create_connection(("127.0.0.1", rig.sim_port))
    good = frame_of(DATA, 1, struct.pack(">HHHHH5i", 1, 0x1C, 1, 1, 0x24, 0, 0, 0, 0, 0))
    rig.observer.wires[1].socket.sendall(good * (10000 // len(good)))
    nonsense.sendall(b"\xa0\xa0nonsense")
    for _ in range(10000 // len(good)):
        Observer.receive(rig.observer.wires[1])
    rig.row("another client sends 10,000 merged bytes of requests, a third one nonsense, in mid-program", rig.result(client), {OK}, "^OK",
            stands=False)
    rig.recover()
    for what, harm in (("one byte at a time", lambda: setattr(rig.proxy, "byte_by_byte", True)),
                       ("10,000 foreign bytes merged before each reply", lambda: setattr(rig.proxy, "down", flood))):
        rig.arm()
        harm()
        rig.row(f"{what}, a program runs", rig.result(rig.start_program(CUT)), {OK}, "^OK", stands=False)
        rig.recover()


def flood(frame):
    foreign = frame_of(0x33, 2, bytes(90), 3)
    return foreign * 101 + frame if frame[6] == DATA else frame


def of_the_codes(rig):
    """Every error code of a start: told by its name, not armed, nothing moved."""
    rig.call("cnc/arm_motion", "ArmMotion", arm=False)
    told = []
    for code in [c for c in range(-17, 22) if c != 0]:
        rig.proxy.down = lambda frame: frame if frame[6:8] != bytes((DNC_START, 2)) else frame_of(
            DNC_START, ERROR, struct.pack(">4h", 0, code, 0, 0), 3)
        time.sleep(0.05)
        answer = rig.call("cnc/arm_motion", "ArmMotion", arm=True)
        told.append(answer)
        # The controller has begun a session that the bridge takes for refused.
        rig.panel("reset")
        if answer.code == 0 or rig.state.armed or not answer.message.startswith("motion is not armed: ") or "\n" in answer.message:
            rig.bad += 1
            print(f"   code {code}: {answer}", flush=True)
    rig.proxy.calm()
    rig.row(f"{len(told)} error codes of a start, -17 to 21", told[29], range(1, 9), "disarmed", "EW_REJECT")
    rig.recover()


def of_the_panel(rig):
    for what, harm, codes, pattern, line in (
            ("reset in mid-DNC", lambda: rig.panel("reset"), {CANCELLED}, "^OK: .*disarmed", "reset"),
            ("emergency stop in mid-DNC", lambda: rig.panel("emergency_stop", 1.0), {ALARM}, "^ERROR: emergency stop", "emergency"),
            ("mode changed in mid-DNC", lambda: rig.panel("mode", 1.0), {4, CANCELLED}, "^WARN: .*DNC mode", "")):
        rig.arm()
        client = rig.start_program(LONG)
        rig.moving()
        rig.diagnostic = ""
        harm()
        rig.row(what, rig.result(client), codes, pattern, line)
        rig.recover()
    in_mid_jog(rig, "alarm 3003 in mid-jog", lambda: rig.panel("alarm", 3003.0, text="TOOL MET HAMMER x"), {ALARM}, "^ERROR: alarm .*3003",
               "3003|EW_ALARM")


def of_the_sessions(rig):
    """The bridge loses its own while others take all five."""
    rig.observer.close()
    time.sleep(0.2)
    rig.proxy.down = lambda frame: (b"",)
    until(lambda: not rig.state.connected)
    others = []
    until(lambda: not try_session(rig.sim_port, others))
    rig.proxy.calm()
    pattern = "all its sessions may be taken"
    said = rig.told(pattern)
    answer = rig.call("cnc/arm_motion", "ArmMotion", arm=True)
    rig.observer = others[0]
    rig.row(f"a sixth session, the bridge's, beside {len(others)}", answer, {1, 2, 3}, pattern)
    if len(others) != 5 or pattern not in said:
        rig.bad += 1
    for other in others[1:]:
        other.close()
    rig.recover()


def try_session(port, sessions):
    try:
        sessions.append(Observer(port))
        return True
    except OSError:
        return False


def of_the_hold(rig):
    rig.arm()
    answer = rig.call("cnc/feed_hold", "FeedHold")
    rig.row("feed hold asked of a Fanuc", answer, {1, 2, 3}, "^OK", "feed hold")


def of_the_clock(rig):
    """Bridge and controller live by ROS time here, which jumps."""
    from rosgraph_msgs.msg import Clock
    offset, done = [0.0], threading.Event()
    publisher = rig.rospy.Publisher("/clock", Clock, queue_size=10)
    rig.house.kill("cnc", signal.SIGTERM)
    rig.rospy.set_param("/use_sim_time", True)

    def tick():
        while not done.is_set():
            publisher.publish(Clock(rig.rospy.Time.from_sec(time.time() + offset[0])))
            time.sleep(0.002)
    threading.Thread(target=tick, daemon=True).start()
    rig.state.connected = False
    rig.house.node("cnc", "smartmill_cnc", "cnc_node")
    until(lambda: rig.state.connected)
    for jump in (3600.0, -3600.0):
        rig.arm()
        client = rig.start_program(CUT)
        rig.moving()
        offset[0] += jump
        result = rig.result(client)
        rig.row(f"clock jumps by {jump:+.0f} s in mid-program", result, {OK}, "^OK", stands=False)
        if "the clock jumped" not in rig.house.log("cnc"):
            rig.bad += 1
            print("   the log does not tell it", flush=True)
    done.set()


HAMMER_STEPS = ("stopping and orienting", "moving to the hammer station", "searching a flute at the tip", "lowering the tool",
                "searching the flute halfway", "flute at", "turning the flute", "calibrating the displacement sensor",
                "sensor calibrated", "hit 1 of 2", "retracting")


def measure_until(rig, step, harm):
    """Does the harm at the first word of a step. @return whether the step came, what the measurement answered"""
    from smartmill_msgs.msg import MeasureFrfGoal
    rig.arm()
    goal = MeasureFrfGoal(tool="mill", point="tool_tip", direction="x", hits=2, modes=1, teeth=4)
    goal.header.stamp = rig.rospy.Time.now()
    rig.measure.wait_for_server(rig.rospy.Duration(PATIENCE))
    reached = threading.Event()

    def feedback(told):
        if told.stage.startswith(step) and not reached.is_set():
            harm()
            reached.set()
    rig.measure.send_goal(goal, feedback_cb=feedback)
    until(lambda: reached.is_set() or rig.measure.simple_state == 2, 240.0)
    return reached.is_set(), rig.result(rig.measure)


def at_each_step_of_the_hammer(rig):
    for step in HAMMER_STEPS:
        # The controller's server alone, as if its network were off: the sensors live on, the machine keeps its place.
        reached, result = measure_until(rig, step, rig.proxy.shut)
        said = rig.told("trying again")
        moved, quiet = rig.stands()
        rig.proxy.listen()
        until(lambda: rig.state.connected)
        rig.row(f'server gone and back at "{step}"', result, {4}, "disarmed", "connection", before=said)
        rig.retract()
        # The whole process, sensors too.
        reached_too, result = measure_until(rig, step, lambda: rig.house.kill("sim"))
        said = rig.told("trying again")
        rig.house.node("sim", "smartmill_sim", "sim_node")
        rig.watch_anew()
        until(lambda: rig.state.connected)
        rig.row(f'process killed and started anew at "{step}"', result, {4, 6}, "disarmed", before=said)
        rig.recover()
        if not (reached and reached_too and quiet) or moved:
            rig.bad += 1
            print(f"   reached {reached} {reached_too}, moved {moved} mm, quiet {quiet}", flush=True)


FAULTS = (of_the_hold, of_the_server, of_the_wire, of_the_codes, of_the_panel, of_the_sessions, of_the_bridge, of_the_clock)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hammer", action="store_true", help="the steps of the hammer's measurement")
    parser.add_argument("--only", default="", help="those faults whose function's name has it")
    parser.add_argument("--out", help="file for the table")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="node_faults") as folder:
        rig = Rig(folder, options.hammer)
        try:
            for fault in (at_each_step_of_the_hammer,) if options.hammer else FAULTS:
                if options.only in fault.__name__:
                    fault(rig)
        except Exception:
            for name in rig.house.children:
                print(f"--- {name}\n{rig.house.log(name)[-2000:]}", file=sys.stderr)
            raise
        finally:
            rig.house.end()
    if options.out:
        pathlib.Path(options.out).write_text("\n".join(rig.rows) + "\n")
    print(f"{len(rig.rows)} faults, {rig.bad} not as they have to be")
    # rospy's threads wait for a master that has gone.
    sys.stdout.flush()
    os._exit(1 if rig.bad else 0)


main()
