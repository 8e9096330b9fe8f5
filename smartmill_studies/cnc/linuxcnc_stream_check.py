#!/usr/bin/env python3
"""Checks that every servo cycle of a LinuxCNC is published as spindle/angle and in cnc/servo: linuxcnc_machine and cnc_node under a
separate ROS master, with the spindle at 6000 rpm and consecutive programs of 5 s, for MINUTES.

usage: devel/env.sh smartmill_studies/cnc/linuxcnc_stream_check.py [MINUTES]   (default 10; in the repository's folder)
Exit code 1: a sample was lost, a step was not a millisecond, or a program did not complete.
"""
import os
import struct
import subprocess
import sys
import tempfile
import time

from ros_processes import PATIENCE, ROOT, RosProcesses, until

PERIOD = 1e-3  # [s]
STEP_TOLERANCE = 5e-6  # [s] the stamps follow the controller's clock by at most 1e-4 of the time from block to block


class Angles:
    """Decodes spindle/angle (SpindleAngle: sequence, seconds, nanoseconds, frame, angle, speed)."""

    def __init__(self):
        self.count, self.odd, self.last, self.late = 0, 0, None, []

    def take(self, message):
        _, seconds, nanoseconds, size = struct.unpack_from("<4I", message._buff)
        stamp = seconds + 1e-9 * nanoseconds
        self.late.append(time.time() - stamp)
        if self.last is not None and abs(stamp - self.last - PERIOD) > STEP_TOLERANCE:
            self.odd += 1
            print(f"a step of {1e3 * (stamp - self.last):.3f} ms", flush=True)
        self.last = stamp
        self.count += 1


class Blocks:
    def __init__(self):
        self.count, self.lost, self.next = 0, 0, None

    def take(self, block):
        size = len(block.samples) // len(block.channels)
        self.lost += 0 if self.next is None else block.first_index - self.next
        self.next = block.first_index + size
        self.count += size


def start(processes, folder):
    model = ROOT / "launch/models/mill.yaml"
    processes.rospy.set_param("/smartmill/cnc", {"model": str(model), "controller": "linuxcnc", "linuxcnc_folder": folder,
                                             "read_only": False, "reconnect_period": 0.2})
    programs = ROOT / "devel/lib/smartmill_cnc"
    processes.run("linuxcnc", [str(ROOT / "smartmill_cnc/scripts/linuxcnc_machine"), str(model), folder], {"SMARTMILL_CNC_BIN": str(programs)})
    subprocess.run([str(programs / "linuxcnc_panel"), folder, "ready", "--wait", "60"], check=True, stdout=subprocess.DEVNULL)
    processes.node("cnc", "smartmill_cnc", "cnc_node")
    processes.join("linuxcnc_stream_check")


def follow(rospy, minutes):
    """(started programs, completed programs)"""
    import actionlib
    from smartmill_msgs.msg import RunProgramAction, RunProgramGoal
    from smartmill_msgs.srv import ArmMotion
    rospy.wait_for_service("/smartmill/cnc/arm_motion", PATIENCE)
    arm = rospy.ServiceProxy("/smartmill/cnc/arm_motion", ArmMotion)
    if not until(lambda: arm(arm=True).code == 0):
        raise SystemExit("not armed: " + arm(arm=True).message)
    client = actionlib.SimpleActionClient("/smartmill/cnc/run_program", RunProgramAction)
    client.wait_for_server(rospy.Duration(PATIENCE))
    begun = done = 0
    end = time.monotonic() + 60.0 * minutes
    while time.monotonic() < end:
        goal = RunProgramGoal(name="forward and back", program="S6000 M3\nG91 G1 X10 F240\nX-10\n")
        goal.header.stamp = rospy.Time.now()
        client.send_goal(goal)
        begun += 1
        if until(lambda: client.simple_state == 2) and client.get_result().code == 0:
            done += 1
        else:
            print("program: " + (client.get_result().message if client.get_result() else "no result"), flush=True)
            arm(arm=True)
    return begun, done


def main():
    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else 10.0
    with tempfile.TemporaryDirectory(prefix="linuxcnc_check") as logs, tempfile.TemporaryDirectory(dir="/dev/shm") as folder:
        os.chmod(folder, 0o755)  # root runs LinuxCNC as an unprivileged user
        processes = RosProcesses(logs)
        try:
            start(processes, folder + "/machine")
            from smartmill_msgs.msg import SampleBlock
            angles, blocks = Angles(), Blocks()
            processes.rospy.Subscriber("/smartmill/spindle/angle", processes.rospy.AnyMsg, angles.take, queue_size=None)
            processes.rospy.Subscriber("/smartmill/cnc/servo", SampleBlock, blocks.take, queue_size=None)
            if not until(lambda: blocks.count > 0):
                raise SystemExit("cnc/servo is silent: " + processes.log("cnc")[-500:])
            begun, done = follow(processes.rospy, minutes)
            load = os.getloadavg()[1]
        finally:
            processes.end(gently="linuxcnc")
    late = sorted(angles.late)
    print(f"spindle/angle: {angles.count} samples, {angles.odd} steps other than 1 ms; late {1e3 * late[len(late) // 2]:.1f} ms median, "
          f"{1e3 * late[len(late) * 99 // 100]:.1f} ms 99 %, {1e3 * late[-1]:.0f} ms worst (measured in Python)")
    print(f"cnc/servo: {blocks.count} samples, {blocks.lost} lost; programs {done} of {begun} completed; load {load:.1f}", flush=True)
    os._exit(1 if angles.odd or blocks.lost or done != begun else 0)  # rospy's threads wait for the stopped master


main()
