"""Cutting forces of a slot, simulated: over two revolutions and as a spectrum. Writes slot_forces.png."""
import math

import matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import smartmill

tool = smartmill.Tool(teeth=3, diameter=0.012, helix=math.radians(35.0))
aluminium = smartmill.Coefficients(ktc=953e6, krc=357e6, kac=188e6, kte=17.3e3, kre=17.7e3, kae=0.72e3)
cut = smartmill.Cut.of(speed_rpm=4500, feed_mm=0.08, depth_mm=2.0)
record = smartmill.simulate(smartmill.machine_model(tool, aluminium), cut, duration=0.4, rate=30000, noise=False)

# Mean forces of a slot in closed form: N b / 4 (c Krc + 4 Kre / pi) and so on.
n, b, c, k = tool.teeth, cut.axial_depth, cut.feed_per_tooth, aluminium
expected = {"fx": -n * b * (c * k.krc / 4 + k.kre / math.pi), "fy": n * b * (c * k.ktc / 4 + k.kte / math.pi),
            "fz": n * b * (c * k.kac / math.pi + k.kae / 2)}
turn = round(2.0 * math.pi / cut.spindle_speed * record.rate)  # samples

fig, (over_angle, spectrum) = plt.subplots(1, 2, figsize=(11, 4.2), constrained_layout=True)
for place, (channel, color) in enumerate(zip(expected, ("tab:blue", "tab:red", "tab:green"))):
    force = record[channel]
    print(f"{channel}: mean {force.mean():8.3f} N, closed form {expected[channel]:8.3f} N")  # 30 whole revolutions
    over_angle.plot(360.0 * np.arange(2 * turn) / turn, force[:2 * turn], color=color, label=channel)
    over_angle.axhline(expected[channel], color=color, ls=":", lw=1)
    amplitude = 2.0 * np.abs(np.fft.rfft(force)) / len(force)
    frequency = np.fft.rfftfreq(len(force), 1.0 / record.rate)
    shown = (frequency > 1.0) & (frequency < 2500.0) & (amplitude > 0.05)
    spectrum.bar(frequency[shown] + 40.0 * (place - 1), amplitude[shown], width=40.0, color=color)  # next to each other
over_angle.set(xlabel="Spindle angle [deg]", ylabel="Force on the tool [N] (dotted: mean, closed form)",
               xlim=(0, 720), ylim=(-170, 250), xticks=range(0, 721, 120),
               title=f"Slot, {record.speed_rpm:.0f} rpm, {1e3 * b:g} mm deep, {1e3 * c:g} mm per tooth")
over_angle.legend(loc="upper center", ncol=3)
spectrum.set(xlabel="Frequency [Hz]", ylabel="Amplitude [N]", yscale="log", ylim=(0.05, 100.0),
             title=f"Harmonics of the tooth passing frequency, {n * record.speed_rpm / 60:.0f} Hz")
spectrum.yaxis.set_major_formatter("{x:g}")
fig.savefig("slot_forces.png", dpi=120)
