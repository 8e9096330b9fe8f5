"""Stability lobes, probability of chatter, and a speed at which a deep cut is safe. Writes chatter_free_speed.png."""
import math

import matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import smartmill
from smartmill import Coefficients, Estimate, Mode, Tool

tool = Tool(teeth=3, diameter=0.012, helix=math.radians(35.0))
aluminium = Coefficients(ktc=Estimate(953e6, 20e6), krc=Estimate(357e6, 15e6))  # [N/m2]
tip = [Mode(frequency=Estimate(920.0, 5.0), damping_ratio=Estimate(0.025, 0.002), gain=Estimate(1.6e-7, 5e-9))]
model = smartmill.machine_model(tool, aluminium, tool_tip={"x": tip, "y": tip})

speeds = np.linspace(6500.0, 13500.0, 141)  # [rpm]
down_milling = dict(entry_deg=90.0, exit_deg=180.0)
lobes = smartmill.lobes(model, speeds, max_depth=0.005, **down_milling)
risk = smartmill.chatter_risk(model, speeds[::2], np.linspace(5e-5, 5e-3, 100), draws=20, risk=0.05, **down_milling)
best = risk.points[0]
print(f"stable at every speed: {lobes.depth_mm.min():.3f} mm")
print(f"best: {best.speed_rpm:.0f} rpm, {best.depth_mm:.2f} mm, probability of chatter {best.probability:.3f}")

fig, chart = plt.subplots(figsize=(9.5, 5), constrained_layout=True)
shade = chart.pcolormesh(risk.speed_rpm, 1e3 * risk.depth, risk.probability.T, cmap="YlOrRd", shading="gouraud",
                         vmin=0, vmax=1)
fig.colorbar(shade, label="Probability of chatter")
chart.plot(lobes.speed_rpm, np.minimum(lobes.depth_mm, 5.0), color="black", lw=1.5, label="limit of the model")
chart.plot(best.speed_rpm, best.depth_mm, "*", ms=18, color="tab:blue", mec="white",
           label=f"{best.speed_rpm:.0f} rpm, {best.depth_mm:.1f} mm: chatter at most {100 * best.probability:.0f} %")
chart.set(xlabel="Spindle speed [rpm]", ylabel="Axial depth [mm]", xlim=(6500, 13500), ylim=(0.05, 5.0),
          title="Down-milling, half immersion, 3 teeth, 12 mm")
chart.legend(loc="upper right", framealpha=1.0)
fig.savefig("chatter_free_speed.png", dpi=120)
