"""From dynamometer records to the force on the tool and to cutting coefficients. Writes dynamometer.png.

usage: dynamometer.py CAMPAIGN    a folder with campaign.yaml, cuts at two feeds or more and taps of the dynamometer
"""
import math
import sys

import matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import smartmill

campaign = sys.argv[1]
measured = smartmill.read_campaign(campaign)
force = smartmill.compensate(campaign, identify=True)
found = smartmill.coefficients(campaign, means="revolutions")
for axis, modes in force.sensor.items():
    print(f"sensor {axis}: " + ", ".join(f"{mode.frequency} Hz" for mode in modes))
print(found)



def distortion(name):
    """RMS of what the sensor's vibration adds in the second half of a record [N]."""
    half = len(measured[name].time) // 2
    return math.hypot(*(np.std((measured[name][axis] - force[name][axis])[half:]) for axis in ("fx", "fy")))


name = max(force.records, key=distortion)
record, compensated = measured[name], force[name]
fig, (over_angle, values) = plt.subplots(1, 2, figsize=(11, 4.5), width_ratios=(2, 1), constrained_layout=True)
turn = 2.0 * math.pi / record.spindle_speed  # [s]
shown = record.time > record.time[-1] - 2.0 * turn
angle = 360.0 * (record.time[shown] - record.time[shown][0]) / turn
for channel, color in (("fx", "tab:blue"), ("fy", "tab:red")):
    over_angle.plot(angle, record[channel][shown], color=color, lw=1, alpha=0.4, label=f"{channel} measured")
    over_angle.plot(angle, compensated[channel][shown], color=color, lw=2, label=f"{channel} on the tool")
over_angle.set(xlabel="Spindle angle [deg]", ylabel="Force [N]", xlim=(0, 720),
               xticks=range(0, 721, 120), title=f"{name}: {record.speed_rpm:.0f} rpm, sensor vibration compensated")
over_angle.margins(y=0.2)
over_angle.legend(ncol=4, loc="upper center", fontsize=9)
for place, key in enumerate(("ktc", "krc", "kac")):
    value = smartmill.Estimate(getattr(found.coefficients, key) / 1e6, getattr(found.coefficients, key).std / 1e6)
    values.bar(key.capitalize(), value, yerr=2.0 * value.std, color="tab:gray", capsize=8)
    values.annotate(str(value), (place, value), (0, 6), textcoords="offset points", ha="center", fontsize=9)
values.margins(y=0.1)
values.set(ylabel="Coefficient [N/mm2]", title=f"From {found.tests} cuts")
fig.savefig("dynamometer.png", dpi=120)
