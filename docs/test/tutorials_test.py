"""The commands of the tutorials run in an empty folder, in their order, and print what the tutorials show.

$SMARTMILL is the program. Numbers agree within console.TOLERANCE.
"""
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import tempfile
import unittest

import console

ROOT = pathlib.Path(__file__).resolve().parents[2]
TUTORIALS = ROOT / "docs/tutorials"
FOCAS_PORT = "8193"  # in the text; here a free one


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return str(s.getsockname()[1])


class ConsoleTest(unittest.TestCase):
    """The comparison itself."""

    def test_numbers_within_the_tolerance(self):
        self.assertTrue(console.agrees("820.00 +- 0.0050 Hz", "  819.1  +- 0.0051 Hz"))
        self.assertFalse(console.agrees("820.00 Hz", "790.00 Hz"))
        self.assertFalse(console.agrees("820.00 Hz", "820.00 kHz"))
        self.assertFalse(console.agrees("1 of 5", "2 of 5"))
        self.assertTrue(console.agrees("phase 0.0", "phase -0.0"))

    def test_words_left_out(self):
        self.assertTrue(console.agrees("[ ... s] ok Ktc 800", "[  125.2 s] ok  Ktc 801"))
        self.assertFalse(console.agrees("[ ... s] ok Ktc 800", "[ 125.2 s] ok Ktc 900"))
        self.assertFalse(console.agrees("[ ... s] ok Ktc 800", "( 125.2 s) ok Ktc 800"))
        self.assertFalse(console.agrees("[ ... s] ok Ktc 800", ""))

    def test_lines_left_out(self):
        self.assertEqual(console.difference(["a", "...", "c"], ["a", "b", "b", "c"]), "")
        self.assertEqual(console.difference(["a", "..."], ["a", "b"]), "")
        self.assertIn("expected 'c'", console.difference(["a", "c"], ["a", "b"]))
        self.assertIn("expected 'c'", console.difference(["a", "...", "c"], ["a", "b"]))
        self.assertIn("after the expected", console.difference(["a"], ["a", "b"]))


class TutorialsTest(unittest.TestCase):
    def run_tutorial(self, name):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        program = pathlib.Path(os.environ["SMARTMILL"])
        environment = {**os.environ, "PATH": f"{program.parent}:/usr/bin:/bin", "TUTORIALS": str(TUTORIALS), "LC_ALL": "C"}
        port = free_port()
        steps = console.steps(TUTORIALS / f"{name}.md")
        commands = [step for step in steps if isinstance(step, console.Command)]
        self.assertGreaterEqual(len(commands), 2)
        for step in steps:
            if isinstance(step, console.File):
                (pathlib.Path(folder.name) / step.name).write_text(step.text, encoding="utf-8")
                continue
            text = step.text.replace(FOCAS_PORT, port)
            expected = [line.replace(FOCAS_PORT, port) for line in step.output]
            where = f"{name}.md:{step.line}: {step.text}"
            if text.endswith("&"):
                self.run_behind(text.rstrip("& "), expected, folder.name, environment, where)
                continue
            done = subprocess.run(["bash", "-c", text], cwd=folder.name, env=environment, capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, f"{where}: {done.stderr}")
            self.assertEqual(console.difference(expected, done.stdout.splitlines()), "", where)

    def run_behind(self, text, expected, folder, environment, where):
        """A command that runs until the tutorial's end; its first lines are compared."""
        process = subprocess.Popen(["bash", "-c", "exec " + text], cwd=folder, env=environment, stdout=subprocess.PIPE,
                                   stderr=subprocess.STDOUT, text=True)
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.send_signal, signal.SIGINT)
        printed = [process.stdout.readline().rstrip("\n") for _ in expected]
        self.assertEqual(console.difference(expected, printed), "", where)

    @unittest.skipUnless(shutil.which("c++"), "c++ is not installed")
    def test_add_effect(self):
        """The files of the effect compile."""
        files = [step for step in console.steps(TUTORIALS / "add_effect.md") if isinstance(step, console.File)]
        self.assertEqual([pathlib.Path(file.name).name for file in files], ["amplifier_bend.cpp", "amplifier_bend_test.cpp"])
        for file in files:
            core = ROOT / "src/smartmill_core"
            folders = [core / "include", core / "src", core / "testing/include", ROOT / "smartmill_sim/include", ROOT / pathlib.Path(file.name).parent,
                       "/usr/include/eigen3"]
            done = subprocess.run(["c++", "-std=c++17", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", *(f"-I{f}" for f in folders), "-x", "c++", "-"],
                                  input=file.text, capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stderr)

    def test_tap_test(self):
        self.run_tutorial("tap_test")

    def test_dynamometer(self):
        self.run_tutorial("dynamometer")

    def test_why(self):
        self.run_tutorial("why")

    def test_chatter_free_speed(self):
        self.run_tutorial("chatter_free_speed")

    def test_fanuc(self):
        self.run_tutorial("fanuc")


if __name__ == "__main__":
    unittest.main()
