"""Errors: arguments, files and data, each in one line; those of files and data as the program prints them."""
import math
import unittest

import numpy as np
import smartmill
from shared import MODEL, FolderTest, program, shared, subset
from smartmill import Coefficients, Cut, Mode, Tool

ALUMINIUM = Coefficients(ktc=953e6, krc=357e6)


class ArgumentsTest(unittest.TestCase):
    def expect(self, line, function, *arguments, error=smartmill.UsageError, **options):
        with self.assertRaises(error) as caught:
            function(*arguments, **options)
        self.assertEqual(str(caught.exception), line)

    def test_usage_errors_are_value_errors(self):
        self.assertTrue(issubclass(smartmill.UsageError, ValueError))
        self.assertTrue(issubclass(smartmill.Error, RuntimeError))

    def test_arrays(self):
        signal, sensor = np.zeros(100), {"x": []}
        with_nan = signal.copy()
        with_nan[7] = math.nan
        options = dict(rate=1000.0, sensor=sensor, speed_rpm=3000.0)
        for line, fx, fy in (
                ("fx: nan at index 7, expected finite numbers", with_nan, signal),
                ("fy: nan at index 7, expected finite numbers", signal, with_nan),
                ("fy: expected 100 samples as in the others, got 99", signal, signal[1:]),
                ("fx: expected a 1-D array of float64, got shape (10, 10)", signal.reshape(10, 10), signal),
                ("fx: expected an array of real numbers (float64), got dtype complex128", signal + 1j, signal),
                ("fx: expected an array of real numbers (float64), got dtype bool", signal > 0, signal),
                ("fx: expected at least 2 samples, got 1", signal[:1], signal),
                ("fx: expected an array of numbers, got rows of different lengths", [[1.0, 2.0], [1.0]], signal)):
            self.expect(line, smartmill.compensate, fx, fy, signal, **options)
        self.expect("force: expected an array of shape (2, 3) (cuts, 3), got (3, 2)", smartmill.coefficients_of_means,
                    Tool(3, 0.012), 2 * [Cut.of(speed_rpm=3000, feed_mm=0.1, depth_mm=1)], np.zeros((3, 2)))
        self.expect("speeds_rpm: expected positive numbers, each above the one before", smartmill.lobes, MODEL,
                    [3000.0, 2000.0], max_depth=0.01)
        self.expect("value: expected a complex array of shape (20,) as frequency, got dtype complex128, shape (19,)",
                    smartmill.modes, np.arange(20.0), np.zeros(19, dtype=complex))
        self.expect("value: nan+0j at index 3, expected finite numbers".replace("nan+0j", str(np.complex128(math.nan))),
                    smartmill.modes, np.arange(20.0), np.where(np.arange(20) == 3, math.nan, 1.0) + 0j)
        self.expect("response: expected as many hits and samples as in force", smartmill.frf, np.zeros((2, 50)),
                    np.zeros((2, 40)), 1000.0)
        self.expect("samples: expected channels of one length", smartmill.detect, [signal, signal[1:]], 1000.0,
                    speed_rpm=3000, teeth=2)

    def test_numbers(self):
        for line, options in (
                ("max_depth: 0 m, expected a value > 0", dict(max_depth=0)),
                ("max_depth: nan m, expected a value > 0", dict(max_depth=math.nan)),
                ("max_depth: expected a number, got str", dict(max_depth="0.01")),
                ("entry_deg: inf, expected a value finite", dict(max_depth=0.01, entry_deg=math.inf)),
                ("method: 'exact', expected one of collocation, semi_discretization, multi_frequency, zero_order",
                 dict(max_depth=0.01, method="exact")),
                ("progress: expected a function of share and line, got int", dict(max_depth=0.01, progress=1))):
            self.expect(line, smartmill.lobes, MODEL, [3000.0], **options)
        self.expect("threads: 0, expected an integer 1..64", smartmill.gap, "nowhere", threads=0)
        self.expect("threads: expected an integer, got float", smartmill.gap, "nowhere", threads=2.0)
        self.expect("campaign: expected a path, got int", smartmill.gap, 5)
        self.expect("rate: expected the sample rate [Hz] of the samples", smartmill.detect, np.zeros(10), speed_rpm=1,
                    teeth=1)
        self.expect("high: 100 Hz, expected a value above low (200 Hz)", smartmill.frf, "hit.csv", low=200, high=100)
        self.expect("response: expected the response to each hit", smartmill.frf, np.zeros(50))
        self.expect("compensate: arrays need fx, fy, fz, rate, sensor and speed_rpm", smartmill.compensate,
                    np.zeros(50))

    def test_wrong_types_inside_dataclasses(self):
        model = smartmill.machine_model(Tool(3, 0.012), ALUMINIUM)
        self.expect("must be real number, not str", smartmill.simulate, model, Cut(300.0, 1e-4, "deep"),
                    error=TypeError)
        self.expect("'float' object cannot be interpreted as an integer", smartmill.machine_model, Tool(3.0, 0.012),
                    error=TypeError)

    def test_models_from_numbers(self):
        self.expect("tool_tip axis: 'z', expected one of x, y", smartmill.machine_model, tool_tip={"z": []})
        self.expect("tool_tip['x'][0].frequency: -5 Hz, expected a value > 0", smartmill.machine_model,
                    tool_tip={"x": [Mode(-5.0, 0.02, 1e-7)]})
        self.expect("force_sensor['z'][0].gain: nan, expected a value finite", smartmill.machine_model,
                    force_sensor={"z": [Mode(900.0, 0.02, math.nan)]})
        for tool in (Tool(0, 0.012), Tool(3, -0.012), Tool(3, 0.012, pitch=(1.0, 2.0)), Tool(3, math.nan)):
            with self.assertRaisesRegex(smartmill.Error, "^tool "):
                smartmill.machine_model(tool)
        cut = Cut.of(speed_rpm=3000, feed_mm=0.1, depth_mm=-1)
        with self.assertRaisesRegex(smartmill.Error, "^axial depth: "):
            smartmill.simulate(smartmill.machine_model(Tool(3, 0.012), ALUMINIUM), cut)
        with self.assertRaisesRegex(smartmill.Error, "^model: .*tool"):
            smartmill.lobes(smartmill.machine_model(cutting=ALUMINIUM), [3000.0], max_depth=0.01)


class ProgramErrorsTest(FolderTest):
    """The line is the one that the program prints behind its name."""

    def setUp(self):
        super().setUp()
        self.out = self.folder / "out"

    def expect(self, function, *command):
        with self.assertRaises(smartmill.Error) as caught:
            function()
        self.assertNotIn("\n", str(caught.exception))
        printed = program(*command, folder=self.folder)
        self.assertEqual(printed.returncode, 1, printed.stderr)
        self.assertEqual(printed.stderr.splitlines()[-1], f"smartmill {command[0]}: {caught.exception}")

    def expect_of_lobes(self, model):
        self.expect(lambda: smartmill.lobes(model, [3000.0], max_depth=0.01), "lobes", model, "--entry-deg", 0,
                    "--exit-deg", 180, "--speeds", "3000:3000:1", "--max-depth-mm", 10, "-o", self.folder / "c.csv")

    def expect_of_detect(self, sound, speed_rpm):
        self.expect(lambda: smartmill.detect(sound, speed_rpm=speed_rpm, teeth=4), "detect", sound, "--speed", speed_rpm,
                    "--teeth", 4)

    def write(self, name, text):
        file = self.folder / name
        file.write_text(text)
        return file

    def test_files_that_are_missing(self):
        campaign, file = self.folder / "campaign", self.folder / "hit.csv"
        self.expect(lambda: smartmill.gap(campaign), "gap", campaign)
        self.expect(lambda: smartmill.explain(campaign), "explain", campaign, "-o", self.out)
        self.expect(lambda: smartmill.simulate(MODEL, campaign), "simulate", MODEL, campaign, "-o", self.out)
        self.expect(lambda: smartmill.frf(file), "frf", file, "-o", self.out)
        self.expect_of_lobes(self.folder / "model.yaml")
        self.expect_of_detect(self.folder / "cut.wav", 6000)

    def test_models(self):
        text = MODEL.read_text()
        for changed in (text.replace("teeth: 2", "teeth: two"), text.replace("600.0", ".nan"),
                        text.replace("diameter_mm", "diameter"), text.replace("0.011", "1.1"), "tool: [", ""):
            self.expect_of_lobes(self.write("model.yaml", changed))

    def test_campaigns(self):
        campaign = subset(shared("campaigns/none"), self.folder / "campaign", "slot_4500_060")
        record, plan = campaign / "slot_4500_060.csv", campaign / "campaign.yaml"
        good, lines = plan.read_text(), record.read_text().splitlines(keepends=True)
        record.unlink()
        commands = ((lambda: smartmill.gap(campaign), ("gap", campaign)),
                    (lambda: smartmill.coefficients(campaign), ("coefficients", campaign)),
                    (lambda: smartmill.compensate(campaign), ("compensate", campaign, "-o", self.out)))
        for rows in (lines[:1], lines[:5] + ["1,2,x,4,5,6\n"], lines[:5] + ["1,2,nan,4,5,6\n"], lines[:5] + ["1,2\n"]):
            record.write_text("".join(rows))
            for function, command in commands:
                self.expect(function, *command)
        record.write_text("".join(lines))
        for text in (good.replace("4500.0", "fast"), good.replace("kind: cut", "kind: bore"),
                     good.replace("axial_depth_mm: 2.0", "axial_depth_mm: -2.0"), good + "surplus: 1\n"):
            plan.write_text(text)
            for function, command in commands:
                self.expect(function, *command)
        plan.write_text(good)
        self.expect(lambda: smartmill.compensate(campaign, identify=True), "compensate", campaign, "--identify", "-o",
                    self.out)
        for source in ("force", "load_meter"):
            self.expect(lambda: smartmill.coefficients(campaign, source=source), "coefficients", campaign, "--source",
                        source)

    def test_hits(self):
        hit = shared("measured/five_hits") / "hit_1.csv"
        short = self.write("short.csv", "".join(hit.read_text().splitlines(keepends=True)[:30]))
        text = self.write("notes.txt", "not a record\n")
        silent = self.write("silent.csv", "time[s],hammer[N],displacement[m]\n" + "".join(
            f"{k * 1e-4:.4f},{0.01 * (k % 2)},{1e-9 * (k % 3)}\n" for k in range(4096)))
        for file in (short, text, silent):
            self.expect(lambda: smartmill.frf(file), "frf", file, "-o", self.out, "--no-picture")
        frf = self.write("frf.csv", "".join(f"{k},{1e-7 * k},{-1e-8}\n" for k in range(1, 400)))
        self.expect(lambda: smartmill.frf([hit, frf]), "frf", hit, frf, "-o", self.out)

    def test_sounds(self):
        self.expect_of_detect(self.write("cut.wav", "no sound"), 6000)
        self.expect_of_detect(shared("measured/sound_mill/chatter.wav"), 600000)

    def test_a_report_that_cannot_be_written(self):
        campaign, out = shared("campaigns/none"), self.write("file", "") / "out"
        self.expect(lambda: smartmill.explain(campaign, out=out), "explain", campaign, "-o", out)
