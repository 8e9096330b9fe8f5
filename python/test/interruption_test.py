"""Ctrl-C, progress, and other Python threads during long work.

Work that opens a FIFO without a writer cannot end by itself: no test depends on time.
"""
import concurrent.futures
import os
import signal
import subprocess
import sys
import threading
import time

import smartmill
from shared import FolderTest, shared, subset

TIMEOUT = 120.0  # [s] of a process that hangs


class FifoCampaignTest(FolderTest):
    """A campaign whose first record is a FIFO: opening it waits for a writer."""

    CALLS = ("smartmill.explain(campaign)", "smartmill.gap(campaign)", "smartmill.simulate(None, campaign)",
             "smartmill.compensate(campaign)", "smartmill.read_campaign(campaign)")

    def setUp(self):
        super().setUp()
        self.campaign = subset(shared("campaigns/none"), self.folder / "campaign", "slot_4500_060", "slot_4500_100")
        self.record = self.campaign / "slot_4500_060.csv"
        self.record.unlink()
        os.mkfifo(self.record)

    def run_calls(self, script):
        """The output of the script for each call, which has the names campaign and record."""
        for call in self.CALLS:
            names = f"import smartmill\ncampaign, record = {str(self.campaign)!r}, {str(self.record)!r}\n"
            done = subprocess.run([sys.executable, "-c", names + script.format(call)], capture_output=True, text=True,
                                  timeout=TIMEOUT)
            yield call, (done.returncode, done.stdout, done.stderr)


class InterruptionTest(FifoCampaignTest):
    """The work has a thread of its own: when that exists, the call waits for it."""

    def test_ctrl_c_ends_a_call_whose_work_does_not_answer(self):
        for call, outcome in self.run_calls("""
import os, signal, threading, time
def threads():
    return len(os.listdir("/proc/self/task"))
def interrupt():
    while threads() == before:
        time.sleep(0.01)
    os.kill(os.getpid(), signal.SIGINT)
before = threads() + 1  # with the one that interrupts
threading.Thread(target=interrupt).start()
try:
    {}
except KeyboardInterrupt:
    print("interrupted")
os.open(record, os.O_RDWR)  # ends the abandoned work
"""):
            self.assertEqual(outcome, (0, "interrupted\n", ""), call)

    def test_a_second_ctrl_c_ends_the_process_that_waits_for_the_work(self):
        process = subprocess.Popen([sys.executable, "-c", """
import os, sys, smartmill
print(len(os.listdir("/proc/self/task")), flush=True)
smartmill.gap(sys.argv[1])
""", self.campaign], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        with process:
            before = int(process.stdout.readline())
            while len(os.listdir(f"/proc/{process.pid}/task")) == before:
                time.sleep(0.01)
            process.send_signal(signal.SIGINT)
            line = "Traceback"
            while line not in ("", "KeyboardInterrupt\n"):
                line = process.stderr.readline()
            while process.poll() is None:
                process.send_signal(signal.SIGINT)
                time.sleep(0.01)
        self.assertEqual(line, "KeyboardInterrupt\n")
        self.assertEqual(process.returncode, -signal.SIGINT)


class OtherThreadsTest(FifoCampaignTest):
    def test_they_run_during_a_call(self):
        for call, outcome in self.run_calls("""
import threading
threading.Thread(target=lambda: open(record, "wb").close()).start()
try:
    {}
except smartmill.Error:  # a FIFO is no record
    print("ended")
"""):
            self.assertEqual(outcome, (0, "ended\n", ""), call)

    def test_calls_in_two_threads_do_not_mix(self):
        model = smartmill.machine_model(smartmill.Tool(3, 0.012), smartmill.Coefficients(9e8, 3e8))
        cuts = [smartmill.Cut.of(speed_rpm=3000, feed_mm=0.1, depth_mm=depth) for depth in (1.0, 2.0)]
        alone = [smartmill.simulate(model, cut)["fy"] for cut in cuts]
        with concurrent.futures.ThreadPoolExecutor(2) as threads:
            together = list(threads.map(lambda cut: smartmill.simulate(model, cut)["fy"], cuts))
        for one, other in zip(alone, together):
            self.assertTrue((one == other).all())


class ProgressTest(FolderTest):
    def setUp(self):
        super().setUp()
        self.calls = []

    def progress(self, share, line):
        self.assertIs(threading.current_thread(), threading.main_thread())
        self.calls.append((share, line))

    def air_cuts(self):
        return subset(shared("campaigns/stribeck_friction"), self.folder / "campaign", "air_1000", "air_3000",
                      "air_6000", "air_9000", "air_12000", "air_18000")

    def expect_rising_to_one(self):
        shares = [share for share, _ in self.calls]
        self.assertEqual(shares, sorted(shares))
        self.assertGreaterEqual(shares[0], 0.0)
        self.assertEqual(shares[-1], 1.0)

    def test_shares_rise_to_one(self):
        model = smartmill.machine_model(smartmill.Tool(2, 0.02), smartmill.Coefficients(6e8, 2e8),
                                        tool_tip={"x": [smartmill.Mode(900.0, 0.02, 1e-7)]})
        speeds = [5000.0 + 100.0 * i for i in range(60)]
        smartmill.lobes(model, speeds, max_depth=0.01, progress=self.progress)
        self.expect_rising_to_one()
        self.assertEqual(len(self.calls), 4)  # 0, 25 and 50 of 60 speeds, and all
        self.calls.clear()
        smartmill.chatter_risk(model, speeds[::20], [0.001, 0.002], draws=5, progress=self.progress)
        self.expect_rising_to_one()

    def test_a_campaign_is_reported_test_by_test(self):
        smartmill.simulate(None, self.air_cuts(), progress=self.progress)
        self.expect_rising_to_one()
        self.assertEqual([line for _, line in self.calls][1:3], ["simulating air_3000", "simulating air_6000"])

    def test_explain_reports_what_it_does(self):
        smartmill.explain(self.air_cuts(), progress=self.progress)
        self.expect_rising_to_one()
        self.assertTrue(any("stribeck" in line.lower() for _, line in self.calls), self.calls)

    def test_false_ends_the_search_with_its_result(self):
        found = smartmill.explain(self.air_cuts(), out=self.folder / "out", progress=lambda share, line: False)
        self.assertTrue(found.interrupted)
        self.assertIn('"interrupted": true', (self.folder / "out" / "report.json").read_text())

    def test_an_exception_of_the_callback_ends_the_call(self):
        def fail(share, line):
            raise ZeroDivisionError(line)
        with self.assertRaisesRegex(ZeroDivisionError, "reading"):
            smartmill.explain(self.air_cuts(), progress=fail)

    def test_ctrl_c_during_a_search(self):
        def interrupt(share, line):
            self.calls.append((share, line))
            if len(self.calls) == 3:
                os.kill(os.getpid(), signal.SIGINT)
        campaign = self.air_cuts()
        with self.assertRaises(KeyboardInterrupt):
            smartmill.explain(campaign, progress=interrupt)
        self.assertEqual(len(self.calls), 3)
        self.assertEqual(len(smartmill.read_campaign(campaign)), 6)  # the module works on
