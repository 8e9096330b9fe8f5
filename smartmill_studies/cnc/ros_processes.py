"""Processes of the project under a separate ROS master, each of which can be killed and restarted."""
import logging
import os
import pathlib
import signal
import socket
import subprocess
import time

PATIENCE = 60.0  # [s] long, since the computer may be slow
ROOT = pathlib.Path(__file__).resolve().parents[2]


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as s:
        return s.getsockname()[1]


def until(condition, seconds=PATIENCE):
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True


class RosProcesses:
    """The processes, with their output in FOLDER/NAME.log."""

    def __init__(self, folder):
        self.folder, self.children = pathlib.Path(folder), {}
        os.environ.update(ROS_MASTER_URI=f"http://localhost:{free_port()}", ROS_HOSTNAME="localhost", ROS_LOG_DIR=folder,
                          ROS_HOME=folder)
        self.run("master", ["rosmaster", "--core", "-p", os.environ["ROS_MASTER_URI"].rsplit(":", 1)[1]])
        # These modules read the master's address at import.
        import rosgraph
        import rospy
        self.rospy = rospy
        until(rosgraph.is_master_online)

    def join(self, name):
        """Makes this process a node."""
        self.rospy.init_node(name, disable_signals=True)
        logging.getLogger("rosout").setLevel(logging.CRITICAL)

    def run(self, name, command, environment=None):
        log = open(self.folder / f"{name}.log", "ab")
        self.children[name] = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, env={**os.environ, **(environment or {})})

    def node(self, name, package, program):
        self.run(name, [str(ROOT / "devel/lib" / package / program), "__ns:=/smartmill", f"__name:={name}"])

    def kill(self, name, how=signal.SIGKILL):
        self.children[name].send_signal(how)
        if how in (signal.SIGKILL, signal.SIGTERM):
            self.children[name].wait(PATIENCE)

    def end(self, gently=""):
        """gently: name of a process that ends its children, and gets SIGTERM"""
        for name, child in reversed(list(self.children.items())):
            if child.poll() is None:
                child.send_signal(signal.SIGCONT)
                child.send_signal(signal.SIGTERM if name == gently else signal.SIGKILL)
                child.wait(PATIENCE)

    def log(self, name):
        return (self.folder / f"{name}.log").read_text(errors="replace")
