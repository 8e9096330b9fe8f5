"""Numbers of the module next to those of the program `smartmill`, on the shared campaigns and records.

Tolerances are the digits that the program prints.
"""
import json
import math
import re

import numpy as np
import smartmill
from shared import MODEL, FolderTest, program, shared, subset

COEFFICIENTS = ("ktc", "krc", "kac", "kte", "kre", "kae")


def columns(file):
    """The columns of a CSV file in SI units, by their names without units; empty cells: NaN."""
    with open(file) as lines:
        names = next(lines).strip().split(",")
        chosen = [i for i, name in enumerate(names) if name != "kind"]
        values = np.loadtxt(lines, delimiter=",", ndmin=2, usecols=chosen, converters=lambda cell: float(cell or "nan"))
    return {names[i].partition("[")[0]: column * (1e-6 if names[i].endswith("[um]") else 1.0)
            for i, column in zip(chosen, values.T)}


def numbers(file):
    """The numbers of a YAML file's lines `key: value`, by key; of a key that returns, in a list."""
    found = {}
    for key, value in re.findall(r"(\w+): (-?[\d.]+(?:e[-+]?\d+)?)$", file.read_text(), re.MULTILINE):
        found.setdefault(key, []).append(float(value))
    return found


class ProgramTest(FolderTest):
    def run_program(self, *arguments):
        done = program(*arguments, folder=self.folder)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def test_gap(self):
        for name in ("none", "runout", "vibrating_runout"):
            campaign = shared("campaigns") / name
            found = smartmill.gap(campaign)
            printed = self.run_program("gap", campaign)
            self.assertIn(f"overall gap {found.overall:.4f}\n", printed)
            rows = [f"{row.test:24} {row.channel:12} {row.gap:8.3f} {row.residual_rms:14.4g}" for row in found.channels]
            self.assertEqual(rows, printed.splitlines()[1:len(rows) + 1])
            for channel, largest in found.largest.items():
                self.assertIn(f"largest {channel:12} {largest:8.3f} (noise {found.noise[channel]:.4g})\n", printed)

    def test_gap_with_another_model(self):
        campaign, model = shared("campaigns/none"), shared("campaigns/runout/model.yaml")
        found = smartmill.gap(campaign, model, threads=1)
        self.assertIn(f"overall gap {found.overall:.4f}\n", self.run_program("gap", campaign, "--model", model))

    def test_simulate(self):
        for name, options, noise in (("none", (), True), ("vibrating_none", ("--noise", "off"), False)):
            campaign = shared("campaigns") / name
            out = self.folder / name
            self.run_program("simulate", campaign / "model.yaml", campaign, "-o", out, "--seed", "5", *options)
            records = smartmill.simulate(None, campaign, noise=noise, seed=5)
            self.assertEqual(len(records), 21)
            for record in records.values():
                written = columns(out / f"{record.name}.csv")
                self.assertEqual(list(written), ["time", *record.channels])
                for channel, values in record.channels.items():
                    np.testing.assert_allclose(values, written[channel], rtol=1e-5, atol=1e-12, err_msg=record.name)

    def test_read_campaign(self):
        campaign = shared("campaigns/none")
        for record in smartmill.read_campaign(campaign).values():
            written = columns(campaign / f"{record.name}.csv")
            np.testing.assert_array_equal(record.time, written.pop("time"))
            for channel, values in written.items():
                np.testing.assert_array_equal(record[channel], values)

    def test_coefficients(self):
        campaign = shared("campaigns/none")
        for options in (dict(source="force"), dict(source="force", means="revolutions"), dict(source="load_meter")):
            arguments = [word for key, value in options.items() for word in (f"--{key}", value)]
            printed = self.run_program("coefficients", campaign, *arguments, "-o", "cutting.yaml")
            found = smartmill.coefficients(campaign, **options)
            self.assertRegex(printed, f"^from the (forces of|load meter in) {found.tests} cuts")
            written = numbers(self.folder / "cutting.yaml")
            for name in COEFFICIENTS:
                value = getattr(found.coefficients, name)
                suffix, unit = ("n_per_mm2", 1e6) if name.endswith("c") else ("n_per_mm", 1e3)
                key = f"{name.capitalize()}_{suffix}"
                if key in written:
                    np.testing.assert_allclose((value / unit, value.std / unit), written[key] + written[f"{key}_std"],
                                               rtol=1e-9)
                else:
                    self.assertTrue(math.isnan(value), name)
            self.assertEqual(len(written), 12 if options["source"] == "force" else 4)
            if options["source"] == "load_meter":
                self.assertIn(f"{found.friction_viscous:.4e} Nm s/rad viscous, {found.friction_coulomb:.4f} Nm", printed)

    def test_compensate(self):
        campaign = subset(shared("campaigns/none"), self.folder / "campaign", "tap_x", "tap_y", "slot_9000",
                          "slot_13950")
        for options in (dict(), dict(identify=True, method="smoother"), dict(method="inverse"),
                        dict(method="fixed-lag", lag=0.02), dict(method="delay", noise_rms=2.0, bandwidth=3000.0)):
            names = {"lag": "--lag-s", "noise_rms": "--noise-rms-n", "bandwidth": "--bandwidth-hz"}
            arguments = [word for key, value in options.items() for word in
                         (("--identify",) if value is True else (names.get(key, f"--{key}"), value))]
            out = self.folder / "_".join(map(str, options.values()))
            self.run_program("compensate", campaign, *arguments, "-o", out)
            found = smartmill.compensate(campaign, **options)
            self.assertEqual(list(found.records), ["slot_9000", "slot_13950"])
            for name, record in found.records.items():
                written = columns(out / f"{name}.csv")
                for channel in ("fx", "fy", "fz"):
                    np.testing.assert_allclose(record[channel], written[channel], rtol=1e-5, atol=1e-5,
                                               err_msg=f"{options} {name}")

    def test_compensated_arrays_are_those_of_the_campaign(self):
        campaign = shared("campaigns/none")
        whole = smartmill.compensate(campaign, identify=True)
        record = smartmill.read_campaign(campaign)["slot_9000"]
        found = smartmill.compensate(record["fx"], record["fy"], record["fz"], rate=record.rate, sensor=whole.sensor,
                                     speed_rpm=record.speed_rpm)
        for channel in ("fx", "fy", "fz"):
            np.testing.assert_allclose(getattr(found, channel), whole["slot_9000"][channel], rtol=1e-9, atol=1e-9)

    def test_lobes(self):
        for method in ("collocation", "zero_order"):
            self.run_program("lobes", MODEL, "--entry-deg", 90, "--exit-deg", 180, "--speeds", "4000:12000:81",
                             "--max-depth-mm", 2, "--method", method, "-o", "chart.csv")
            written = columns(self.folder / "chart.csv")
            found = smartmill.lobes(MODEL, np.linspace(4000.0, 12000.0, 81), max_depth=0.002, entry_deg=90.0,
                                    method=method)
            np.testing.assert_allclose(found.speed_rpm, written["rpm"], rtol=1e-7)
            limited = np.isfinite(found.depth)
            np.testing.assert_array_equal(limited, np.isfinite(written["limit_mm"]))
            np.testing.assert_allclose(found.depth_mm[limited], written["limit_mm"][limited], rtol=1e-7)
            np.testing.assert_allclose(found.frequency[limited], written["chatter_hz"][limited], rtol=1e-7)
            rows = (self.folder / "chart.csv").read_text().splitlines()[1:]
            self.assertEqual(list(found.kind), [row.rsplit(",", 1)[1] or "none" for row in rows])

    def test_chatter_risk(self):
        printed = self.run_program("chatter-probability", MODEL, "--entry-deg", 0, "--exit-deg", 180, "--speeds",
                                   "4000:6000:5", "--depths-mm", "0.1:1:10", "--draws", 8, "--seed", 3, "-o", "grid.csv")
        written = columns(self.folder / "grid.csv")
        found = smartmill.chatter_risk(MODEL, np.linspace(4000.0, 6000.0, 5), np.linspace(1e-4, 1e-3, 10), draws=8,
                                       seed=3)
        np.testing.assert_allclose(found.probability.ravel(), written["probability"], rtol=1e-7)
        np.testing.assert_allclose(1e3 * found.nominal, written["nominal_limit_mm"][::10], rtol=1e-7)
        for point in found.points[:5]:
            line = f"{point.speed_rpm:8.1f} rpm {point.depth_mm:8.4f} mm  {100.0 * point.probability:4.1f} %"
            self.assertIn(line, printed)

    def test_frf(self):
        hits = sorted(shared("measured/five_hits").glob("*.csv"))
        for options in (dict(), dict(low=700.0, high=3200.0, real_modes=True, average="h2")):
            arguments = [word for key, value in options.items() for word in
                         ((f"--{key.replace('_', '-')}",) if value is True else (f"--{key}", value))]
            self.run_program("frf", *hits, *arguments, "--no-picture", "-o", "out")
            found = smartmill.frf(hits, **options)
            written, modes = columns(self.folder / "out" / "frf.csv"), numbers(self.folder / "out" / "modes.yaml")
            np.testing.assert_allclose(found.frequency, written["frequency_hz"], rtol=1e-9)
            for part in ("real", "imag"):
                np.testing.assert_allclose(getattr(found.value, part), written[part], rtol=1e-8, atol=1e-18)
            for name in ("std", "coherence"):
                np.testing.assert_allclose(getattr(found, name), written[name], rtol=1e-8)
            self.assertGreater(len(found.modes), 5)
            both = found.modes + found.doubts
            for name, key, scale in (("frequency", "frequency_hz", 1.0), ("damping_ratio", "damping_ratio", 1.0),
                                     ("stiffness", "stiffness_n_per_um", 1e-6)):
                found_here = [getattr(mode, name) for mode in both]
                np.testing.assert_allclose([scale * value for value in found_here], modes[key], rtol=1e-8)
                np.testing.assert_allclose([scale * value.std for value in found_here], np.abs(modes[f"{key}_std"]),
                                           rtol=1e-3)
            np.testing.assert_allclose([m.evidence for m in both], modes["evidence"], rtol=1e-3)

    def test_arrays_of_hits_give_what_their_files_give(self):
        hits = sorted(shared("measured/five_hits").glob("*.csv"))[:3]
        records = [columns(hit) for hit in hits]
        response = next(name for name in records[0] if name not in ("time", "hammer"))
        rate = 1.0 / np.diff(records[0]["time"]).mean()
        found = smartmill.frf([r["hammer"] for r in records], [r[response] for r in records], rate, kind=response,
                              high=3000.0)
        of_files = smartmill.frf(hits, high=3000.0)
        np.testing.assert_allclose(found.value, of_files.value, rtol=1e-6)
        np.testing.assert_allclose([m.frequency for m in found.modes], [m.frequency for m in of_files.modes], rtol=1e-6)
        again = smartmill.modes(of_files.frequency, of_files.value, of_files.std, high=3000.0)
        np.testing.assert_allclose([m.frequency for m in again.modes], [m.frequency for m in of_files.modes], rtol=1e-6)

    def test_detect(self):
        sounds = shared("measured/sound_mill")
        verdicts = {}
        for name, rpm in (("chatter", 12918), ("no_chatter", 5496), ("idle_after", 12918)):
            sound = sounds / f"{name}.wav"
            found = smartmill.detect(sound, speed_rpm=rpm, teeth=4)
            self.assertEqual(f"{found}\n", self.run_program("detect", sound, "--speed", rpm, "--teeth", 4))
            verdicts[name] = bool(found)
        self.assertEqual(verdicts, {"chatter": True, "no_chatter": False, "idle_after": False})

    def test_explain(self):
        campaign = subset(shared("campaigns/runout"), self.folder / "campaign", "slot_3000", "slot_4500_060",
                          "slot_4500_100")
        printed = self.run_program("explain", campaign, "-o", "program", "--threads", "1")
        found = smartmill.explain(campaign, out=self.folder / "module", threads=1)
        report = json.loads((self.folder / "program" / "report.json").read_text())
        self.assertEqual(found.summary, printed)
        self.assertEqual((found.verdict, [effect.name for effect in found.effects]), (report["verdict"], ["runout"]))
        effect, = found.effects
        for key, value in effect.parameters.items():
            written = report["effects"][0]["parameters"][key]
            np.testing.assert_allclose((value, value.std), (written["value"], written["std"]), rtol=1e-5)
        self.assertEqual(*((self.folder / folder / "model.yaml").read_text() for folder in ("program", "module")))
        self.assertTrue((self.folder / "module" / "report.html").exists())
        self.assertEqual([name for name, _ in found.model.effects], ["runout"])
        for key, hidden in (("offset_um", 21.08), ("angle_deg", 261.8)):  # truth.yaml
            value = effect.parameters[key]
            self.assertLess(abs(value - hidden), 4.0 * value.std + 0.005, key)
