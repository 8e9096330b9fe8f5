"""Numbers of the module next to closed forms and to calculations of this file."""
import math
import unittest

import numpy as np
import smartmill
from smartmill import Coefficients, Cut, Estimate, Mode, Tool

ALUMINIUM = Coefficients(ktc=953e6, krc=357e6, kac=188e6, kte=17.3e3, kre=17.7e3, kae=0.72e3)


def mean_force_matrix(teeth, cut):
    """Mean forces x, y, z of a slot per coefficient (ktc, krc, kac, kte, kre, kae), in closed form."""
    chip, edge = teeth * cut.axial_depth * cut.feed_per_tooth, teeth * cut.axial_depth
    return np.array([[0.0, -chip / 4, 0.0, 0.0, -edge / math.pi, 0.0],
                     [chip / 4, 0.0, 0.0, edge / math.pi, 0.0, 0.0],
                     [0.0, 0.0, chip / math.pi, 0.0, 0.0, edge / 2]])


def values(coefficients):
    return np.array([coefficients.ktc, coefficients.krc, coefficients.kac, coefficients.kte, coefficients.kre,
                     coefficients.kae])


class RigidToolTest(unittest.TestCase):
    def forces(self, tool, cut):
        record = smartmill.simulate(smartmill.machine_model(tool, ALUMINIUM), cut, duration=0.1, rate=20000, phase=0.3,
                                    noise=False)
        return record, np.array([record["fx"], record["fy"], record["fz"]])

    def test_a_straight_tooth_cuts_with_the_force_of_its_chip(self):
        for entry, exit in ((0.0, 180.0), (0.0, 90.0), (60.0, 180.0)):
            cut = Cut.of(speed_rpm=4500, feed_mm=0.08, depth_mm=2.0, entry_deg=entry, exit_deg=exit)
            record, force = self.forces(Tool(teeth=3, diameter=0.012), cut)
            expected = np.zeros_like(force)
            clear = np.ones(len(record.time), dtype=bool)  # no tooth enters or leaves within a sample
            for tooth in range(3):
                angle = np.mod(0.3 + cut.spindle_speed * record.time + tooth * 2.0 * np.pi / 3.0, 2.0 * np.pi)
                inside = (angle > cut.entry) & (angle < cut.exit)
                chip = cut.feed_per_tooth * np.sin(angle)
                t, r, a = (inside * cut.axial_depth * (kc * chip + ke) for kc, ke in (
                    (ALUMINIUM.ktc, ALUMINIUM.kte), (ALUMINIUM.krc, ALUMINIUM.kre), (ALUMINIUM.kac, ALUMINIUM.kae)))
                expected += [-t * np.cos(angle) - r * np.sin(angle), t * np.sin(angle) - r * np.cos(angle), a]
                for edge in (cut.entry, cut.exit):
                    distance = np.abs(np.mod(angle - edge + np.pi, 2.0 * np.pi) - np.pi)
                    clear &= distance > cut.spindle_speed / record.rate
            self.assertGreater(clear.mean(), 0.8)
            np.testing.assert_allclose(force[:, clear], expected[:, clear], rtol=1e-6, atol=1e-6)

    def test_the_mean_force_of_a_slot_does_not_depend_on_the_helix(self):
        cut = Cut.of(speed_rpm=6000, feed_mm=0.08, depth_mm=2.0)
        expected = mean_force_matrix(3, cut) @ values(ALUMINIUM)
        for helix in (0.0, 35.0):
            _, force = self.forces(Tool(teeth=3, diameter=0.012, helix=math.radians(helix)), cut)
            # Ten whole revolutions; the trapezoidal rule over the steps at entry and exit is exact to a sample's share.
            np.testing.assert_allclose(force.mean(axis=1), expected, rtol=5e-3)

    def test_noise_repeats_with_the_seed(self):
        model = smartmill.machine_model(Tool(3, 0.012), ALUMINIUM)
        cut = Cut.of(speed_rpm=6000, feed_mm=0.08, depth_mm=2.0)
        first, same, other = (smartmill.simulate(model, cut, duration=0.02, seed=seed)["fx"] for seed in (1, 1, 2))
        np.testing.assert_array_equal(first, same)
        self.assertFalse(np.array_equal(first, other))


class CoefficientsOfMeansTest(unittest.TestCase):
    tool = Tool(teeth=3, diameter=0.012, helix=math.radians(35.0))
    cuts = [Cut.of(speed_rpm=4500, feed_mm=feed, depth_mm=2.0) for feed in (0.03, 0.06, 0.1, 0.14)]

    def test_exact_means_give_the_coefficients(self):
        force = [mean_force_matrix(3, cut) @ values(ALUMINIUM) for cut in self.cuts]
        found = smartmill.coefficients_of_means(self.tool, self.cuts, force)
        np.testing.assert_allclose(values(found.coefficients), values(ALUMINIUM), rtol=1e-9)
        self.assertEqual((found.source, found.tests), ("force", 4))

    def test_standard_deviations_are_those_of_weighted_least_squares(self):
        design = np.vstack([mean_force_matrix(3, cut) for cut in self.cuts])
        std = np.array([[0.5, 1.0, 0.2], [0.7, 1.0, 0.3], [0.9, 1.5, 0.2], [1.2, 2.0, 0.4]])
        exact = (design @ values(ALUMINIUM)).reshape(-1, 3)
        force = exact + std * np.random.default_rng(1).normal(size=exact.shape)
        weighted = design / std.reshape(-1, 1)
        scale = np.linalg.norm(weighted, axis=0)
        covariance = np.linalg.inv((weighted / scale).T @ (weighted / scale)) / np.outer(scale, scale)
        expected = covariance @ weighted.T @ (force / std).ravel()
        found = smartmill.coefficients_of_means(self.tool, self.cuts, force, std)
        np.testing.assert_allclose(values(found.coefficients), expected, rtol=1e-6)
        np.testing.assert_allclose([k.std for k in vars(found.coefficients).values()], np.sqrt(np.diag(covariance)),
                                   rtol=1e-6)
        np.testing.assert_allclose(found.covariance, covariance, rtol=1e-6, atol=1e-6 * np.abs(covariance).max())


class SingleDegreeOfFreedomTest(unittest.TestCase):
    mass, damping, stiffness = 0.3, 60.0, 12e6  # [kg], [N s/m], [N/m]

    def receptance(self, frequency):
        w = 2.0 * np.pi * np.asarray(frequency)
        return 1.0 / (self.stiffness - self.mass * w**2 + 1j * self.damping * w)

    def mode(self):
        natural = math.sqrt(self.stiffness / self.mass)
        return Mode(natural / (2.0 * math.pi), self.damping / (2.0 * math.sqrt(self.stiffness * self.mass)),
                    1.0 / self.stiffness)

    def expect_mode(self, found):
        """Within four standard deviations, which are below a per cent."""
        for name in ("frequency", "damping_ratio", "gain"):
            value, expected = getattr(found, name), float(getattr(self.mode(), name))
            self.assertLess(abs(value - expected), 4.0 * value.std, f"{name}: {value!r}, {expected}")
            self.assertLess(value.std, 0.01 * expected, name)
        self.assertAlmostEqual(found.stiffness / self.stiffness, 1.0, delta=0.01)

    def test_a_mode_has_the_receptance_of_an_oscillator(self):
        frequency = np.linspace(0.0, 3000.0, 301)
        np.testing.assert_allclose(self.mode().response(frequency), self.receptance(frequency), rtol=1e-12)

    def test_hits_give_receptance_and_mode(self):
        rate, random = 20000.0, np.random.default_rng(3)
        time = np.arange(16384) / rate
        line = np.fft.rfftfreq(len(time), 1.0 / rate)
        pulse = np.where(np.abs(time - 0.02) < 2e-4, np.cos((time - 0.02) * np.pi / 4e-4), 0.0)
        force = [peak * pulse + random.normal(0.0, 0.2, len(time)) for peak in (200.0, 240.0, 180.0)]
        motion = [np.fft.irfft(self.receptance(line) * np.fft.rfft(f)) + random.normal(0.0, 1e-8, len(time))
                  for f in force]
        found = smartmill.frf(force, motion, rate, kind="displacement", high=2000.0)
        self.assertEqual((found.unit, len(found.modes), [hit.accepted for hit in found.hits]), ("m/N", 1, 3 * [True]))
        self.expect_mode(found.modes[0])
        near = (found.frequency > 700.0) & (found.frequency < 1300.0)
        expected = self.receptance(found.frequency[near])
        spectra = np.array([np.fft.rfft(f) for f in force])[:, np.isin(line, found.frequency[near])]
        noise = np.hypot(1e-8, 0.2 * np.abs(expected)) * math.sqrt(len(time)) / np.linalg.norm(spectra, axis=0)
        self.assertEqual(noise.shape, expected.shape)
        self.assertLess(np.max(np.abs(found.value[near] - expected) / noise), 5.0)

    def test_a_measured_response_gives_its_mode(self):
        line, random = np.arange(400.0, 2000.0, 2.0), np.random.default_rng(5)
        std = np.full(len(line), 2e-9)
        noise = (random.normal(size=len(line)) + 1j * random.normal(size=len(line))) * std / math.sqrt(2.0)
        found = smartmill.modes(line, self.receptance(line) + noise, std)
        self.assertEqual(len(found.modes), 1)
        self.expect_mode(found.modes[0])


def zero_order_limits(teeth, kt, kr, start, exit, receptance, speeds):
    """Altintas and Budak (1995): limit [m] at spindle speeds [rad/s] of equal modes in x and y."""
    def alpha(p):
        c, s = np.cos(2.0 * p), np.sin(2.0 * p)
        return 0.5 * np.array([[c - 2.0 * kr * p + kr * s, -s - 2.0 * p + kr * c],
                               [-s + 2.0 * p + kr * c, -c - 2.0 * kr * p - kr * s]])
    limits = np.full(len(speeds), np.inf)
    frequency = np.arange(300.0, 4000.0, 0.05)
    for eigenvalue in np.linalg.eigvals(alpha(exit) - alpha(start)):
        growth = -1.0 / (eigenvalue * receptance(frequency))  # det(I + growth eigenvalue H) = 0
        kappa = growth.imag / growth.real
        depth = -2.0 * np.pi * growth.real / (teeth * kt) * (1.0 + kappa**2)
        for lobe in range(40):
            period = (np.pi - 2.0 * np.arctan(kappa) + 2.0 * np.pi * lobe) / (2.0 * np.pi * frequency)
            speed = 2.0 * np.pi / (teeth * period)
            for k, wanted in enumerate(speeds):
                passed = (speed[:-1] - wanted) * (speed[1:] - wanted) <= 0.0
                i = np.nonzero(passed & (depth[:-1] > 0.0) & (depth[1:] > 0.0))[0]
                share = (wanted - speed[i]) / (speed[i + 1] - speed[i])
                limits[k] = min(limits[k], ((1.0 - share) * depth[i] + share * depth[i + 1]).min(initial=np.inf))
    return limits


class LobesTest(unittest.TestCase):
    tool, kt, kr = Tool(teeth=2, diameter=0.02), 600e6, 200e6
    mode = Mode(Estimate(922.0, 3.0), Estimate(0.011, 0.001), Estimate(7.46e-7, 2e-8))

    def model(self):
        return smartmill.machine_model(self.tool, Coefficients(self.kt, self.kr),
                                       tool_tip={"x": [self.mode], "y": [self.mode]})

    def test_zero_order_limits_are_those_of_altintas_and_budak(self):
        rpm = np.array([6100.0, 8200.0, 9500.0, 12800.0, 15000.0])
        found = smartmill.lobes(self.model(), rpm, max_depth=0.02, method="zero_order")
        expected = zero_order_limits(2, self.kt, self.kr / self.kt, 0.0, np.pi, self.mode.response, found.speed)
        self.assertTrue(np.isfinite(expected).all())
        np.testing.assert_allclose(found.speed_rpm, rpm)
        np.testing.assert_allclose(found.depth, expected, rtol=1e-4)

    def test_two_methods_agree_in_a_slot(self):
        rpm = [4000.0, 9000.0, 14000.0]
        one = smartmill.lobes(self.model(), rpm, max_depth=0.02, errors=True)
        other = smartmill.lobes(self.model(), rpm, max_depth=0.02, method="semi_discretization")
        np.testing.assert_allclose(one.depth, other.depth, rtol=0.01)
        self.assertTrue((one.error < 1e-3 * one.depth).all())

    def test_the_probability_of_chatter_passes_one_half_at_the_limit(self):
        depths = np.linspace(1e-5, 1e-3, 100)
        risk = smartmill.chatter_risk(self.model(), [9000.0, 9600.0], depths, draws=40)
        self.assertEqual(risk.probability.shape, (2, 100))
        self.assertTrue((np.diff(risk.probability, axis=1) >= 0.0).all())
        limits = smartmill.lobes(self.model(), [9000.0, 9600.0], max_depth=0.01).depth
        np.testing.assert_allclose(risk.nominal, limits, rtol=1e-3)
        half = [np.interp(0.5, p, depths) for p in risk.probability]
        # The median of 40 draws scatters by 1.25 / sqrt(40) of the standard deviation.
        self.assertTrue((np.abs(half - limits) < 4.0 * 0.2 * risk.depth_std + 1e-5).all())


class CompensateTest(unittest.TestCase):
    def test_the_force_of_a_cut_is_recovered_from_a_vibrating_sensor(self):
        mode, rate, rpm = Mode(1130.0, 0.035, 1.0), 25600.0, 4500.0
        time = np.arange(25600) / rate
        random = np.random.default_rng(7)
        true = {axis: np.zeros_like(time) for axis in "xyz"}
        measured = {axis: random.normal(0.0, 1.0, len(time)) for axis in "xyz"}
        for axis in "xyz":
            for harmonic in range(1, 16):
                frequency = harmonic * rpm / 60.0
                size = 100.0 / harmonic * np.exp(2j * np.pi * random.uniform())
                wave = size * np.exp(2j * np.pi * frequency * time)
                true[axis] += wave.real
                measured[axis] += (mode.response(frequency) * wave).real
        for method, largest in (("kalman", 0.1), ("smoother", 0.1), ("inverse", 0.5)):  # [N] RMS; noise 1 N
            found = smartmill.compensate(measured["x"], measured["y"], measured["z"], rate=rate, speed_rpm=rpm,
                                         sensor={axis: [mode] for axis in "xyz"}, method=method, bandwidth=1500.0)
            for axis, force in zip("xyz", (found.fx, found.fy, found.fz)):
                settled = slice(12800, -2560)
                distorted = np.sqrt(np.mean((measured[axis] - true[axis])[settled]**2))
                left = np.sqrt(np.mean((force - true[axis])[settled]**2))
                self.assertGreater(distorted, 20.0)
                self.assertLess(left, largest, f"{method} {axis}")


class DetectTest(unittest.TestCase):
    rate, rpm, teeth = 20000.0, 8000.0, 4

    def sound(self, chatter):
        """One second of air, four of cut; forced vibration, and chatter with its side bands."""
        random, time = np.random.default_rng(11), np.arange(100000) / self.rate
        passing = self.teeth * self.rpm / 60.0
        cut = sum(np.sin(2.0 * np.pi * k * passing * time) / k for k in range(1, 6))
        if chatter:
            cut = cut + sum(size * np.sin(2.0 * np.pi * (1234.0 + k * passing) * time + k)
                            for k, size in ((-1, 0.7), (0, 2.0), (1, 0.8)))
        return np.where(time > 1.0, cut, 0.0) + random.normal(0.0, 0.05, len(time))

    def test_chatter_is_found_with_its_frequency(self):
        found = smartmill.detect(self.sound(True), self.rate, speed_rpm=self.rpm, teeth=self.teeth)
        self.assertTrue(found)
        self.assertAlmostEqual(found.frequency, 1234.0, delta=2.0)
        self.assertAlmostEqual(found.spindle_speed * 60.0 / (2.0 * math.pi), self.rpm, delta=8.0)

    def test_forced_vibration_is_no_chatter(self):
        found = smartmill.detect(self.sound(False), self.rate, speed_rpm=self.rpm, teeth=self.teeth)
        self.assertTrue(found.cut)
        self.assertFalse(found)
        self.assertEqual(found.power.shape, (len(found.time), len(found.line)))
