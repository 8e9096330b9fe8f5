#!/usr/bin/env python3
"""Measurement files for the tutorials, of a machine that is computed here: use your own files in their place.

usage: records.py taps FOLDER              five hits of a hammer on a tool: hit_1.csv .. hit_5.csv
       records.py plan FOLDER              a campaign without measured values, for `smartmill simulate`: plan, times, angles, hammer forces
       records.py export CAMPAIGN FOLDER   the records of a campaign as a data acquisition exports them: in volts over milliseconds
"""
import csv
import math
import pathlib
import random
import sys

MODES = ((820.0, 0.02, 12e6), (1430.0, 0.015, 25e6))  # frequency [Hz], damping ratio, stiffness [N/m] of the tool that is tapped
TAP_RATE = 20000.0  # [Hz]
DOUBLE_HIT = 4  # the hammer bounces in this hit
RATE = 12800.0  # [Hz] of the campaign
DURATION = 0.2  # [s] of a cut
FORCE_VOLT, HAMMER_VOLT = 200.0, 50.0  # [N/V] of dynamometer and hammer
SLOTS = ((3000.0, 0.06), (4500.0, 0.03), (4500.0, 0.06), (4500.0, 0.1), (7200.0, 0.06))  # spindle speed [rpm], feed per tooth [mm]


def write(file, columns, rows):
    with open(file, "w", encoding="utf-8") as out:
        out.write(",".join(columns) + "\n")
        out.writelines(",".join(f"{value:.9g}" for value in row) + "\n" for row in rows)


def pulse(time, start, width, peak):
    """Force of a hit [N]: a raised cosine."""
    return 0.5 * peak * (1.0 - math.cos(2.0 * math.pi * (time - start) / width)) if start < time < start + width else 0.0


def response(force, samples, frequency, damping_ratio, stiffness):
    """Displacement [m] of a mode at the samples under a force over time, from rest: exact for a force that is constant in a step."""
    steps = 8  # a sample
    rate = TAP_RATE * steps
    w = 2.0 * math.pi * frequency
    wd, decay = w * math.sqrt(1.0 - damping_ratio**2), math.exp(-damping_ratio * w / rate)
    c, s = decay * math.cos(wd / rate), decay * math.sin(wd / rate)
    ratio = damping_ratio * w / wd
    x = v = 0.0  # displacement, velocity over wd
    for k in range(samples * steps):
        if k % steps == 0:
            yield x
        rest = force((k + 0.5) / rate) / stiffness
        x, v = (rest + (c + ratio * s) * (x - rest) + s * v,
                -(1.0 + ratio**2) * s * (x - rest) + (c - ratio * s) * v)


def taps(folder):
    noise = random.Random(1)
    samples = 8192
    for hit, peak in enumerate((180.0, 220.0, 150.0, 240.0, 200.0), 1):
        starts = (0.02, 0.028) if hit == DOUBLE_HIT else (0.02,)

        def force(time):
            return sum(pulse(time, start, 4.0e-4, peak) for start in starts)

        motion = [sum(x) for x in zip(*(response(force, samples, *mode) for mode in MODES))]
        write(folder / f"hit_{hit}.csv", ("time[s]", "hammer[N]", "displacement[m]"),
              ((k / TAP_RATE, force(k / TAP_RATE) + noise.gauss(0.0, 0.3), motion[k] + noise.gauss(0.0, 2e-8))
               for k in range(samples)))


def plan(folder):
    tests = []
    for direction in "xyz":
        name = f"tap_{direction}"
        tests.append(f"- {{name: {name}, kind: tap, direction: {direction}, sample_rate_hz: {RATE}, file: {name}.csv}}\n")
        times = [k / RATE for k in range(int(2 * DURATION * RATE))]
        write(folder / f"{name}.csv", ("time[s]", "hammer[N]", "fx[N]", "fy[N]", "fz[N]"),
              ((t, pulse(t, 0.02, 4.0e-4, 200.0), 0.0, 0.0, 0.0) for t in times))
    for index, (speed, feed) in enumerate(SLOTS):
        name = f"slot_{speed:.0f}_{1000 * feed:03.0f}"
        tests.append(f"- {{name: {name}, kind: cut, spindle_speed_rpm: {speed}, feed_per_tooth_mm: {feed}, axial_depth_mm: 2.0, "
                     f"entry_deg: 0.0, exit_deg: 180.0, engage_time_s: 0.02, start_time_s: {60.0 * index}, "
                     f"cut_time_before_s: {20.0 * index}, sample_rate_hz: {RATE}, file: {name}.csv}}\n")
        turn = speed / 60.0 * 2.0 * math.pi  # [rad/s]
        write(folder / f"{name}.csv", ("time[s]", "spindle_angle[rad]", "fx[N]", "fy[N]", "fz[N]"),
              ((k / RATE, turn * k / RATE, 0.0, 0.0, 0.0) for k in range(int(DURATION * RATE))))
    (folder / "campaign.yaml").write_text("format: smartmill-campaign/1\nmodel: model.yaml\ntests:\n" + "".join(tests), encoding="utf-8")


def export(campaign, folder):
    channels = {"hammer[N]": ("Ch 4 [V]", HAMMER_VOLT), "fx[N]": ("Ch 1 [V]", FORCE_VOLT), "fy[N]": ("Ch 2 [V]", FORCE_VOLT),
                "fz[N]": ("Ch 3 [V]", FORCE_VOLT)}
    for file in sorted(campaign.glob("*.csv")):
        with open(file, encoding="utf-8", newline="") as record:
            rows = list(csv.DictReader(record))
        present = [name for name in channels if name in rows[0]]
        write(folder / file.name, ("Time [ms]", *(channels[name][0] for name in present)),
              ((1000.0 * float(row["time[s]"]), *(float(row[name]) / channels[name][1] for name in present)) for row in rows))


def main():
    makers = {"taps": (taps, 1), "plan": (plan, 1), "export": (export, 2)}
    maker, count = makers.get(sys.argv[1], (None, 0)) if len(sys.argv) > 1 else (None, 0)
    folders = [pathlib.Path(name) for name in sys.argv[2:]]
    if maker is None or len(folders) != count:
        print(__doc__.split("\n\n")[1], file=sys.stderr, end="")
        return 2
    folders[-1].mkdir(parents=True, exist_ok=True)
    maker(*folders)
    return 0


if __name__ == "__main__":
    sys.exit(main())
