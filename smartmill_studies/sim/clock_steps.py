#!/usr/bin/env python3
"""The clock of the computer is set forwards and backwards while a session runs in the simulated machine: does it end with the results of a session
without this?

usage: devel/env.sh smartmill_studies/sim/clock_steps.py [--seed S] [--steps 5,-5,3600,-3600]                     (in the repository's folder)
--steps: [s] in a drawn order, at drawn times of the session.

Exit code 1: the session was not completed, no node announced a step, or the coefficients of both sessions differ by more than three standard
deviations.
"""
import argparse
import json
import os
import pathlib
import random
import struct
import subprocess
import sys
import tempfile
import threading
import time

from production import free_port

LIBRARY = "devel/lib/libsim_set_clock.so"  # set_clock.cpp
PARAMETERS = "launch/test/short_session.yaml"


def session(folder, steps, draw):
    """@return (exit code, seconds by a clock that is not set, summary, log)"""
    offset, log, summary = folder / "offset", folder / "log.txt", folder / "session.json"
    offset.write_bytes(struct.pack("d", 0.0))
    clock = {"LD_PRELOAD": pathlib.Path(LIBRARY).resolve(), "SET_CLOCK_OFFSET": offset}
    arguments = {"session": "true", "pace": "3.0", "port": free_port(), "database": "none", "session_params": pathlib.Path(PARAMETERS).resolve(),
                 "summary": summary}
    launch = folder / "session.launch"
    launch.write_text("<launch>" + "".join(f'<env name="{name}" value="{value}"/>' for name, value in clock.items()) +
                      '<include file="$(find smartmill_launch)/launch/pipeline.launch">' +
                      "".join(f'<arg name="{name}" value="{value}"/>' for name, value in arguments.items()) + "</include></launch>")
    began = time.monotonic()
    with open(log, "w") as out:
        graph = subprocess.Popen(["roslaunch", "-p", str(free_port()), str(launch)], stdout=out, stderr=subprocess.STDOUT,
                                 env=dict(os.environ, ROS_HOSTNAME="localhost", ROS_HOME=str(folder)))
        ended = threading.Event()

        def step():
            while "ok   connect" not in log.read_text(errors="replace"):
                if ended.wait(0.1):
                    return
            total = 0.0
            for size in steps:
                if ended.wait(draw.uniform(2.0, 5.0)):
                    return
                total += size
                with open(offset, "r+b") as file:  # in place: the programs have mapped it
                    file.write(struct.pack("d", total))

        stepper = threading.Thread(target=step)
        stepper.start()
        try:
            code = graph.wait(timeout=300)
        except subprocess.TimeoutExpired:
            graph.terminate()
            code = -1
        ended.set()
        stepper.join()
    text = summary.read_text() if summary.exists() else "{}"
    return code, time.monotonic() - began, json.loads(text), log.read_text(errors="replace")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", default="5,-5,3600,-3600")
    arguments = parser.parse_args()
    if not pathlib.Path(LIBRARY).exists():
        sys.exit(f"clock_steps: {LIBRARY} not found, expected the target sim_set_clock")
    draw = random.Random(arguments.seed)
    steps = [float(size) for size in arguments.steps.split(",")]
    draw.shuffle(steps)
    failed, found = [], []
    for case in ([], steps):
        with tempfile.TemporaryDirectory() as folder:
            code, seconds, summary, log = session(pathlib.Path(folder), case, draw)
        announced = log.count("the clock of this computer was set by")
        k = (summary.get("coefficients") or [{}])[0]
        found.append(k)
        print(f"{len(case)} steps ({', '.join(f'{s:+.0f} s' for s in case) or 'none'}): exit code {code}, completed {summary.get('completed')}, "
              f"{seconds:.0f} s, {announced} announcements, Ktc {k.get('ktc_n_per_m2', float('nan')) * 1e-6:.2f} +- "
              f"{k.get('ktc_n_per_m2_std', float('nan')) * 1e-6:.2f} N/mm2")
        if code != 0 or not summary.get("completed"):
            failed.append("the session was not completed")
            print(log[-1500:], file=sys.stderr)
        if (announced > 0) != bool(case):
            failed.append(f"{announced} announcements of {len(case)} steps")
    if not failed:
        difference = abs(found[0]["ktc_n_per_m2"] - found[1]["ktc_n_per_m2"])
        scatter = (found[0]["ktc_n_per_m2_std"]**2 + found[1]["ktc_n_per_m2_std"]**2)**0.5
        if difference > 3.0 * scatter:
            failed.append(f"the coefficients differ by {difference / scatter:.1f} standard deviations")
    print("; ".join(failed) or "the sessions agree")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
