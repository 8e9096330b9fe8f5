"""From hammer hits to modes. Writes tap_test.png.

usage: tap_test.py [FILE...]    files of hits of one point; without files five simulated hits
"""
import sys

import matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import smartmill

if len(sys.argv) > 1:
    frf = smartmill.frf(sys.argv[1:])
else:
    rate, random = 20000.0, np.random.default_rng(1)
    time = np.arange(8192) / rate
    pulse = np.where(abs(time - 0.02) < 1e-4, np.cos((time - 0.02) * np.pi / 2e-4), 0.0)
    true = [smartmill.Mode(820.0, 0.02, 1.0 / 12e6), smartmill.Mode(1430.0, 0.015, 1.0 / 25e6)]  # gain [m/N]
    lines = np.fft.rfftfreq(len(time), 1.0 / rate)
    receptance = sum(mode.response(lines) for mode in true)
    force = [size * pulse + random.normal(0.0, 0.3, len(time)) for size in (180.0, 220.0, 150.0, 240.0, 200.0)]
    motion = [np.fft.irfft(receptance * np.fft.rfft(f)) + random.normal(0.0, 2e-8, len(time)) for f in force]
    frf = smartmill.frf(force, motion, rate, kind="displacement", high=3000.0)

for mode in frf.modes:
    k = mode.stiffness
    print(f"{mode.frequency} Hz, damping ratio {mode.damping_ratio}, {k / 1e6:.2f} +- {k.std / 1e6:.2f} N/um")

shown = (frf.frequency > 100.0) & (frf.frequency < 3000.0)
f, h, s = frf.frequency[shown], np.abs(frf.value[shown]), frf.std[shown]
fig, (size, quality) = plt.subplots(2, 1, figsize=(9, 6), sharex=True, height_ratios=(3, 1), constrained_layout=True)
size.fill_between(f, np.maximum(h - 2 * s, 1e-12), h + 2 * s, color="tab:blue", alpha=0.3,
                  label="2 standard deviations")
size.plot(f, h, color="tab:blue", lw=1, label=f"measured, {sum(hit.accepted for hit in frf.hits)} hits")
size.plot(f, np.abs(frf.fitted[shown]), color="black", lw=1, ls="--", label="fitted")
for mode in frf.modes:
    size.axvline(mode.frequency, color="tab:red", lw=0.8)
    size.annotate(f" {mode.frequency:.0f} Hz", (mode.frequency, 0.02), xycoords=("data", "axes fraction"),
                  color="tab:red")
size.set(ylabel=f"Receptance [{frf.unit}]", yscale="log", title=f"Hammer test: {len(frf.modes)} modes")
size.legend()
quality.plot(f, frf.coherence[shown], color="tab:green")
quality.set(xlabel="Frequency [Hz]", ylabel="Coherence [1]", ylim=(0, 1.05), xlim=(100, 3000))
fig.savefig("tap_test.png", dpi=120)
