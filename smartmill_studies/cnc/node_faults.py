#!/usr/bin/env python3
"""Faults between the bridge and a Fanuc, with the real processes: sim_node (the controller), cnc_node (the bridge) and, with --hammer,
hammer_node under a separate ROS master; a proxy between bridge and controller injects the faults. A second FOCAS session,
implemented here from the protocol's description, reads the motion directly from the controller.

usage: devel/env.sh smartmill_studies/cnc/node_faults.py [--hammer] [--only WORD] [--out FILE]   (in the repository's folder)
--hammer: instead of the other faults, kills (SIGKILL) and restarts the controller at each step of the hammer's measurement.
Prints a table: fault, result of the goal, diagnostics, motion. Exit code 1: a row is not as expected.
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

from focas_wire import DATA, DNC_START, ERROR, Observer, Proxy, flood, frame_of, set_at, spoiled, wrong_opcode
from ros_processes import PATIENCE, ROOT, RosProcesses, free_port, until

BRAKED = 0.4  # [s] allowed braking time of a cancelled motion
WATCH = 1.2  # [s] duration of the check that nothing moves


class Rig:
    """The processes with a bridge that is connected through the proxy, and its state and diagnostics."""

    def __init__(self, folder, hammer):
        self.processes, self.sim_port, self.rows, self.bad = RosProcesses(folder), free_port(), [], 0
        self.proxy = Proxy(self.sim_port)
        rospy = self.rospy = self.processes.rospy
        twin, believed = ROOT / "launch/models/mill_twin.yaml", ROOT / "launch/models/mill.yaml"
        rospy.set_param("/smartmill/sim", {"model": str(twin), "port": self.sim_port, "most_behind": 20.0, "substeps": 1})
        # A longer timeout than the default 0.5 s, since the computer may be slow.
        rospy.set_param("/smartmill/cnc", {"model": str(believed), "port": self.proxy.port, "read_only": False,
                                           "reconnect_period": 0.2, "reply_timeout": 2.0})
        rospy.set_param("/smartmill/hammer", {"model": str(believed), "command_machine": True})
        self.processes.node("sim", "smartmill_sim", "sim_node")
        self.processes.node("cnc", "smartmill_cnc", "cnc_node")
        if hammer:
            self.processes.node("hammer", "smartmill_hammer", "hammer_node")
        self.listen()
        self.observer = None
        self.reconnect_observer()

    def listen(self):
        import actionlib
        from diagnostic_msgs.msg import DiagnosticArray
        from smartmill_msgs.msg import CncState, JogAction, MeasureFrfAction, RunProgramAction
        self.processes.join("node_faults")
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

    def reconnect_observer(self):
        """Opens a new session of the observer and selects the DNC mode by sim_node's mode key."""
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
            raise RuntimeError("no controller: " + self.processes.log("sim"))
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
        # actionlib waits in ROS time, which a clock jump would end.
        return client.get_result() if until(lambda: client.simple_state == 2) else None

    # --- results

    def diagnostics_matching(self, pattern):
        """The diagnostics once they match."""
        until(lambda: re.search(pattern, self.diagnostic), 10.0)
        return self.diagnostic

    def motion_after_braking(self):
        """[mm] motion after the braking time, and whether no program runs and the spindle is stopped."""
        time.sleep(BRAKED)
        before = self.observer.read()
        time.sleep(WATCH)
        after = self.observer.read()
        moved = max(abs(a - b) for a, b in zip(before[:3], after[:3]))
        return moved, after[3] == 0.0 and before[5] == after[5] and after[4] in (0, 1)

    def row(self, fault, result, codes, pattern, message_pattern="", must_stop=True, before=""):
        """One line of the table; result: code and message of the goal or the refusal; before: earlier diagnostics."""
        message = result.message if result else "no result"
        code = result.code if result else -1
        said = self.diagnostics_matching(pattern)
        moved, quiet = self.motion_after_braking() if must_stop else (0.0, True)
        good = code in codes and re.search(message_pattern, message) and "\n" not in message and re.search(pattern, said) and moved == 0.0 and quiet
        self.bad += not good
        verdict = ("nothing" if moved == 0.0 and quiet else f"{moved:.4f} mm, quiet: {quiet}") if must_stop else "the complete program"
        said = f"{before}; then {said}" if before else said
        self.rows.append(f"| {fault} | {message} | {said} | {verdict} |" + ("" if good else " <- NOT AS EXPECTED"))
        print(self.rows[-1], flush=True)

    def recover(self):
        """As an operator: no proxy fault, panel reset, connected, armed again; then a jog of 1 mm must work."""
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
            print("   the next jog failed: " + (after.message if after else "no result"), flush=True)
        return was_armed


    def retract(self):
        """The operator retracts the tool upwards."""
        self.arm()
        height = self.observer.read()[2]
        result = self.result(self.start_program(f"G91 G0 Z{-height:.3f}\n"))
        if not result or result.code != 0:
            self.bad += 1
            print("   not retracted: " + (result.message if result else "no result"), flush=True)


OK, CANCELLED, ALARM, LOST, NOT_ARMED = 0, 1, 6, 7, 3
CUT = "G91 G1 X20 F1200\nX-20\n"
LONG = "G91 G1 F6000\n" + "X0.5\nX-0.5\n" * 3000


def in_mid_jog(rig, fault, inject, codes, pattern, message_pattern=""):
    rig.arm()
    client = rig.start_jog()
    rig.moving()
    rig.diagnostic = ""
    inject()
    rig.row(fault, rig.result(client), codes, pattern, message_pattern)
    if rig.state.armed:
        rig.bad += 1
        print("   still armed", flush=True)
    rig.recover()


def of_the_server(rig):
    rig.arm()
    client = rig.start_jog()
    rig.moving()
    rig.processes.kill("sim")
    result = rig.result(client)
    said = rig.diagnostics_matching("127.0.0.1.*trying again")
    rig.processes.node("sim", "smartmill_sim", "sim_node")
    rig.reconnect_observer()
    until(lambda: rig.state.connected)
    rig.row("controller's process killed in mid-jog and restarted", result, {LOST}, "disarmed", "127.0.0.1", before=said)
    rig.recover()

    rig.arm()
    client = rig.start_jog()
    rig.moving()
    rig.processes.kill("sim", signal.SIGSTOP)
    until(lambda: not rig.state.connected)
    said = rig.diagnostics_matching("no answer in time")
    rig.processes.kill("sim", signal.SIGCONT)
    rig.row("controller's process stopped (SIGSTOP) in mid-jog, then continued", rig.result(client), {LOST}, "disarmed",
            "no answer in time", before=said)
    rig.recover()


def of_the_bridge(rig):
    rig.arm()
    rig.start_jog()
    rig.moving()
    rig.processes.kill("cnc")
    moved, quiet = rig.motion_after_braking()
    rig.processes.node("cnc", "smartmill_cnc", "cnc_node")
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
    rig.row("bridge's process killed in mid-jog and restarted; a jog at once", rig.result(rig.jog), {NOT_ARMED}, "OK: .*disarmed")
    if moved or not quiet or armed:
        rig.bad += 1
        print(f"   moved {moved} mm, quiet {quiet}, armed {armed}", flush=True)
    rig.recover()


def of_the_wire(rig):
    cut = lambda frame: (frame[:11],) if frame[6] == DATA else frame
    in_mid_jog(rig, "connection cut in mid-frame, after 11 bytes of a reply", lambda: setattr(rig.proxy, "down", cut), {LOST},
               "closed it|DNC|127.0.0.1", "closed it")
    for what, change, reply_error in (("version 0", set_at(5, 0), "reply with version 0"),
                               ("a length beyond the frame", set_at(12, 0xFF), "data end early"),
                               ("a length of zero", set_at(12, 0, 0), "states a length of 0 bytes"),
                               ("a wrong opcode", wrong_opcode, "answers another request"),
                               ("fewer replies than requested", set_at(11, 1), "1 replies to"),
                               ("no valid frame", set_at(1, 0), "not a FOCAS frame")):
        in_mid_jog(rig, f"replies with {what}", lambda: setattr(rig.proxy, "down", spoiled(change)), {LOST}, reply_error, reply_error)
    silence = lambda frame: b""
    in_mid_jog(rig, "half-open: no replies", lambda: setattr(rig.proxy, "down", silence), {LOST}, "no answer in time",
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
    rig.row("another client sends 10,000 merged bytes of requests, a third one invalid bytes, in mid-program", rig.result(client), {OK}, "^OK",
            must_stop=False)
    rig.recover()
    for what, inject in (("one byte at a time", lambda: setattr(rig.proxy, "byte_by_byte", True)),
                       ("10,000 foreign bytes merged before each reply", lambda: setattr(rig.proxy, "down", flood))):
        rig.arm()
        inject()
        rig.row(f"{what}, a program runs", rig.result(rig.start_program(CUT)), {OK}, "^OK", must_stop=False)
        rig.recover()


def of_the_codes(rig):
    """Every error code of a start: reported by name, not armed, nothing moved."""
    rig.call("cnc/arm_motion", "ArmMotion", arm=False)
    answers = []
    for code in [c for c in range(-17, 22) if c != 0]:
        rig.proxy.down = lambda frame: frame if frame[6:8] != bytes((DNC_START, 2)) else frame_of(
            DNC_START, ERROR, struct.pack(">4h", 0, code, 0, 0), 3)
        time.sleep(0.05)
        answer = rig.call("cnc/arm_motion", "ArmMotion", arm=True)
        answers.append(answer)
        # The controller has begun a session that the bridge regards as refused.
        rig.panel("reset")
        if answer.code == 0 or rig.state.armed or not answer.message.startswith("motion is not armed: ") or "\n" in answer.message:
            rig.bad += 1
            print(f"   code {code}: {answer}", flush=True)
    rig.proxy.calm()
    rig.row(f"{len(answers)} error codes of a start, -17 to 21", answers[29], range(1, 9), "disarmed", "EW_REJECT")
    rig.recover()


def of_the_panel(rig):
    for what, inject, codes, pattern, line in (
            ("reset in mid-DNC", lambda: rig.panel("reset"), {CANCELLED}, "^OK: .*disarmed", "reset"),
            ("emergency stop in mid-DNC", lambda: rig.panel("emergency_stop", 1.0), {ALARM}, "^ERROR: emergency stop", "emergency"),
            ("mode changed in mid-DNC", lambda: rig.panel("mode", 1.0), {4, CANCELLED}, "^WARN: .*DNC mode", "")):
        rig.arm()
        client = rig.start_program(LONG)
        rig.moving()
        rig.diagnostic = ""
        inject()
        rig.row(what, rig.result(client), codes, pattern, line)
        rig.recover()
    in_mid_jog(rig, "alarm 3003 in mid-jog", lambda: rig.panel("alarm", 3003.0, text="TOOL MET HAMMER x"), {ALARM}, "^ERROR: alarm .*3003",
               "3003|EW_ALARM")


def of_the_sessions(rig):
    """The bridge loses its session while other clients take all five."""
    rig.observer.close()
    time.sleep(0.2)
    rig.proxy.down = lambda frame: (b"",)
    until(lambda: not rig.state.connected)
    others = []
    until(lambda: not open_session(rig.sim_port, others))
    rig.proxy.calm()
    pattern = "all its sessions may be taken"
    said = rig.diagnostics_matching(pattern)
    answer = rig.call("cnc/arm_motion", "ArmMotion", arm=True)
    rig.observer = others[0]
    rig.row(f"a sixth session, the bridge's, in addition to {len(others)}", answer, {1, 2, 3}, pattern)
    if len(others) != 5 or pattern not in said:
        rig.bad += 1
    for other in others[1:]:
        other.close()
    rig.recover()


def open_session(port, sessions):
    try:
        sessions.append(Observer(port))
        return True
    except OSError:
        return False


def of_the_hold(rig):
    rig.arm()
    answer = rig.call("cnc/feed_hold", "FeedHold")
    rig.row("feed hold requested from a Fanuc", answer, {1, 2, 3}, "^OK", "feed hold")


def of_the_clock(rig):
    """Jumps of ROS time, which bridge and controller use here."""
    from rosgraph_msgs.msg import Clock
    offset, done = [0.0], threading.Event()
    publisher = rig.rospy.Publisher("/clock", Clock, queue_size=10)
    rig.processes.kill("cnc", signal.SIGTERM)
    rig.rospy.set_param("/use_sim_time", True)

    def tick():
        while not done.is_set():
            publisher.publish(Clock(rig.rospy.Time.from_sec(time.time() + offset[0])))
            time.sleep(0.002)
    threading.Thread(target=tick, daemon=True).start()
    rig.state.connected = False
    rig.processes.node("cnc", "smartmill_cnc", "cnc_node")
    until(lambda: rig.state.connected)
    for jump in (3600.0, -3600.0):
        rig.arm()
        client = rig.start_program(CUT)
        rig.moving()
        offset[0] += jump
        result = rig.result(client)
        rig.row(f"clock jumps by {jump:+.0f} s in mid-program", result, {OK}, "^OK", must_stop=False)
        if "the clock jumped" not in rig.processes.log("cnc"):
            rig.bad += 1
            print("   the log does not report the jump", flush=True)
    done.set()


HAMMER_STEPS = ("stopping and orienting", "moving to the hammer station", "searching a flute at the tip", "lowering the tool",
                "searching the flute halfway", "flute at", "turning the flute", "calibrating the displacement sensor",
                "sensor calibrated", "hit 1 of 2", "retracting")


def measure_until(rig, step, inject):
    """Injects a fault at the beginning of a step. @return whether the step was reached, result of the measurement"""
    from smartmill_msgs.msg import MeasureFrfGoal
    rig.arm()
    goal = MeasureFrfGoal(tool="mill", point="tool_tip", direction="x", hits=2, modes=1, teeth=4)
    goal.header.stamp = rig.rospy.Time.now()
    rig.measure.wait_for_server(rig.rospy.Duration(PATIENCE))
    reached = threading.Event()

    def feedback(progress):
        if progress.stage.startswith(step) and not reached.is_set():
            inject()
            reached.set()
    rig.measure.send_goal(goal, feedback_cb=feedback)
    until(lambda: reached.is_set() or rig.measure.simple_state == 2, 240.0)
    return reached.is_set(), rig.result(rig.measure)


def at_each_step_of_the_hammer(rig):
    for step in HAMMER_STEPS:
        # Only the controller's server, as without network: sensors continue, the machine keeps its position.
        reached, result = measure_until(rig, step, rig.proxy.shut)
        said = rig.diagnostics_matching("trying again")
        moved, quiet = rig.motion_after_braking()
        rig.proxy.listen()
        until(lambda: rig.state.connected)
        rig.row(f'server stopped and restarted at "{step}"', result, {4}, "disarmed", "connection", before=said)
        rig.retract()
        # The complete process, including the sensors.
        reached_too, result = measure_until(rig, step, lambda: rig.processes.kill("sim"))
        said = rig.diagnostics_matching("trying again")
        rig.processes.node("sim", "smartmill_sim", "sim_node")
        rig.reconnect_observer()
        until(lambda: rig.state.connected)
        rig.row(f'process killed and restarted at "{step}"', result, {4, 6}, "disarmed", before=said)
        rig.recover()
        if not (reached and reached_too and quiet) or moved:
            rig.bad += 1
            print(f"   reached {reached} {reached_too}, moved {moved} mm, quiet {quiet}", flush=True)


FAULTS = (of_the_hold, of_the_server, of_the_wire, of_the_codes, of_the_panel, of_the_sessions, of_the_bridge, of_the_clock)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hammer", action="store_true", help="faults at the steps of the hammer's measurement")
    parser.add_argument("--only", default="", metavar="WORD", help="only the faults whose function name contains WORD")
    parser.add_argument("--out", help="file for the table")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="node_faults") as folder:
        rig = Rig(folder, options.hammer)
        try:
            for fault in (at_each_step_of_the_hammer,) if options.hammer else FAULTS:
                if options.only in fault.__name__:
                    fault(rig)
        except Exception:
            for name in rig.processes.children:
                print(f"--- {name}\n{rig.processes.log(name)[-2000:]}", file=sys.stderr)
            raise
        finally:
            rig.processes.end()
    if options.out:
        pathlib.Path(options.out).write_text("\n".join(rig.rows) + "\n")
    print(f"{len(rig.rows)} faults, {rig.bad} not as expected")
    # rospy's threads wait for the stopped master.
    sys.stdout.flush()
    os._exit(1 if rig.bad else 0)


main()
