#!/usr/bin/env python3
"""Self-identification of the shipped mill, whose tool vibrates: a machine with an effect that its model lacks, for each seed.

usage: devel/env.sh smartmill_studies/discrepancy/live_mill.py [--seeds N] [--first S] [--out FOLDER]   (in the repository's folder)
--seeds: number of machines, drawn by `hide` with the seeds from --first on. --out: folder for the results of each.

Prints one line per machine: hidden effect, what was found, gap before and after, wall time of all explanations, largest depth of a slot over the
stability limit that the model in use predicts. Exit code 1: a machine without a result.
"""
import argparse
import csv
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile

import yaml

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "cnc"))
from ros_processes import ROOT, free_port  # noqa: E402

MODEL = ROOT / "launch/models/mill_twin.yaml"
LONGEST = 1800.0  # [s] of one machine
THINKING = 180.0  # [s] target


def largest_share(folder):
    """@return largest depth of a slot over the limit that the model in use predicts for its speed"""
    with open(folder / "stability_0.csv") as file:
        limits = [(float(row["rpm"]), float(row["limit_mm"])) for row in csv.DictReader(file)]
    tests = yaml.safe_load(open(folder / "stretches/campaign.yaml"))["tests"]
    return max(t["axial_depth_mm"] / min(limits, key=lambda point: abs(point[0] - t["spindle_speed_rpm"]))[1] for t in tests if t["kind"] == "cut")


def discover(seed, folder):
    """One machine. @return whether it has a result, and whether what it found is what was hidden"""
    hidden = folder / "hidden.yaml"
    subprocess.run(["rosrun", "smartmill_sim", "hide", str(MODEL), "-o", str(hidden), "--seed", str(seed)], check=True, stdout=subprocess.DEVNULL)
    names = [effect["name"] for effect in yaml.safe_load(open(hidden))["effects"]]
    out = folder / "discovery"
    os.environ.update(ROS_HOME=str(folder / "ros_home"), ROS_HOSTNAME="localhost")
    with open(folder / "log.txt", "wb") as log:
        launch = subprocess.Popen(["roslaunch", "-p", str(free_port()), "smartmill_launch", "discover.launch", f"hidden:={hidden}", f"believed:={MODEL}",
                                   f"folder:={out}", f"port:={free_port()}", "record_after:=0.4"], stdout=log, stderr=subprocess.STDOUT)
        try:
            launch.wait(LONGEST)
        except subprocess.TimeoutExpired:
            launch.send_signal(signal.SIGINT)
            launch.wait()
    try:
        found = json.load(open(out / "discovery.json"))
    except OSError:
        print(f"seed {seed}: {', '.join(names)}: no result", flush=True)
        return False, False
    reports = [json.load(open(report)) for report in sorted(out.glob("explain_*/report.json"))]
    thinking = sum(report["seconds"] for report in reports)
    right = sorted(text.split(":")[0] for text in found["effects"]) == sorted(names)
    print(f"seed {seed}: hidden {', '.join(names)}; {found['verdict']}, {'; '.join(found['effects']) or 'nothing named'}; gap {found['gap_before']:.3g} -> "
          f"{found['gap_after']:.4g}; {len(found['tests'])} suggested tests; {thinking:.0f} s explaining; depth at most {largest_share(out):.2f} of the limit; "
          + ("as hidden" if right else "NOT as hidden") + ("" if thinking <= THINKING else ", TOO LONG"), flush=True)
    return True, right


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--out")
    arguments = parser.parse_args()
    results = []
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        if arguments.out:
            folder = pathlib.Path(arguments.out) / f"seed_{seed}"
            folder.mkdir(parents=True)
            results.append(discover(seed, folder.resolve()))
        else:
            with tempfile.TemporaryDirectory(prefix="live_mill") as temporary:
                results.append(discover(seed, pathlib.Path(temporary)))
    print(f"{sum(right for _, right in results)} of {len(results)} as hidden")
    return 0 if all(done for done, _ in results) else 1


if __name__ == "__main__":
    sys.exit(main())
