"""Why does my machine differ from its model? Writes why.png.

usage: why.py CAMPAIGN    a folder with campaign.yaml and the nominal model
"""
import sys

import matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import smartmill



def report(share, line):
    if line:
        print(f"{100 * share:3.0f} %  {line}", file=sys.stderr)


why = smartmill.explain(sys.argv[1], progress=report)
print(why)
for effect in why.effects:
    print(f"{effect.name}: " + ", ".join(f"{key} {value}" for key, value in effect.parameters.items()))

fig, (over_angle, gaps) = plt.subplots(1, 2, figsize=(12, 4.6), constrained_layout=True)
curve = why.revolutions[0]
over_angle.plot(curve.angle_deg, curve.nominal, color="tab:red", label="nominal model")
over_angle.plot(curve.angle_deg, curve.measured, color="black", lw=2.5, alpha=0.5, label="measured")
over_angle.plot(curve.angle_deg, curve.improved, color="tab:blue", ls="--", label="improved model")
over_angle.set(xlabel="Spindle angle [deg]", ylabel=f"{curve.channel} [N]", xlim=(0, 360), xticks=range(0, 361, 60),
               title=curve.test)
over_angle.legend()
tests = list(dict.fromkeys(gap.test for gap in why.gaps))
for values, color, label in (("before", "tab:red", "before"), ("after", "tab:blue", "after")):
    largest = [max(getattr(gap, values) for gap in why.gaps if gap.test == test) for test in tests]
    gaps.plot(np.maximum(largest, 0.5), range(len(tests)), "o", color=color, label=label)
heldout = {gap.test for gap in why.gaps if gap.heldout}
gaps.set_yticks(range(len(tests)), [test + (" (held out)" if test in heldout else "") for test in tests], fontsize=8)
gaps.axvline(1.0, color="gray", lw=1)
gaps.set(xscale="log", xlabel="Largest gap of the test [1]; 1: the noise floor",
         title=f"{why.verdict.replace('_', ' ')}: {', '.join(effect.name for effect in why.effects)}")
gaps.xaxis.set_major_formatter("{x:g}")
gaps.invert_yaxis()
gaps.legend()
fig.savefig("why.png", dpi=120)
