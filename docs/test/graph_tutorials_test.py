"""The commands of the tutorials that start nodes, on a ROS master of their own.

Background commands run until the first command in the foreground that is none of ROS_COMMANDS.
"""
import os
import pathlib
import shutil
import signal
import subprocess
import tempfile
import time
import unittest

import console
from tutorials_test import TUTORIALS, free_port

ROS_COMMANDS = ("roslaunch", "rosrun", "rostopic")
TIME_LIMIT = 120.0  # [s] of one command; only a fault reaches it
INTERRUPT_LIMIT = 15.0  # [s] from the interrupt to the kill, as in roslaunch: rospy can hang when interrupted while it publishes


def run_graph_tutorial(test, name):
    folder = tempfile.TemporaryDirectory()
    test.addCleanup(folder.cleanup)
    program = pathlib.Path(os.environ["SMARTMILL"])
    environment = {**os.environ, "PATH": f"{program.parent}:/usr/bin:/bin", "TUTORIALS": str(TUTORIALS), "LC_ALL": "C",
                   "ROS_MASTER_URI": f"http://localhost:{free_port()}", "ROS_HOSTNAME": "localhost", "ROS_HOME": folder.name,
                   "XDG_DATA_HOME": folder.name}
    running = []

    def stop():
        for process in reversed(running):
            process.send_signal(signal.SIGINT)
            try:
                process.wait(INTERRUPT_LIMIT)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        running.clear()

    test.addCleanup(stop)
    commands = [step for step in console.steps(TUTORIALS / f"{name}.md") if isinstance(step, console.Command)]
    test.assertGreaterEqual(len(commands), 2)
    for command in commands:
        where = f"{name}.md:{command.line}: {command.text}"
        if command.text.endswith("&"):
            # Not the pipe of the test: a master that outlives its roslaunch would keep it open.
            with open(pathlib.Path(folder.name) / "background.log", "ab") as log:
                running.append(subprocess.Popen(["bash", "-c", "exec " + command.text.rstrip("& ")], cwd=folder.name,
                                                env=environment, stdout=log, stderr=log))
            continue
        if not command.text.startswith(ROS_COMMANDS):
            stop()
        done = run(command.text, folder.name, environment)
        for process in running:
            test.assertIsNone(process.poll(), f"{where}: '{process.args[-1]}' has ended with exit code {process.returncode}: "
                              + (pathlib.Path(folder.name) / "background.log").read_text(errors="replace")[-2000:])
        test.assertEqual(done.returncode, 0, f"{where}: {done.stderr}")
        test.assertEqual(console.difference(command.output, done.stdout.splitlines()), "", where)


def run(text, folder, environment):
    """Runs a command; one that finds no ROS master yet is run again."""
    deadline = time.monotonic() + TIME_LIMIT
    while True:
        done = subprocess.run(["timeout", str(TIME_LIMIT), "bash", "-c", text], cwd=folder, env=environment, capture_output=True, text=True)
        if "communicate with master" not in done.stdout + done.stderr or time.monotonic() > deadline:
            return done
        time.sleep(0.5)


class GraphTutorialsTest(unittest.TestCase):
    def test_add_sensor(self):
        run_graph_tutorial(self, "add_sensor")


@unittest.skipUnless(shutil.which("linuxcnc"), "linuxcnc is not installed (./setup --with-linuxcnc)")
class LinuxCncTutorialTest(unittest.TestCase):
    def test_linuxcnc(self):
        run_graph_tutorial(self, "linuxcnc")


if __name__ == "__main__":
    unittest.main()
