#!/usr/bin/env python3
"""Checks what ./run leaves in its folder results/: the recording, the summary with every target met, the pictures and
the discovery.

usage: check_results.py RESULTS
"""
import json
import pathlib
import sys

MEGABYTE = 1 << 20
FILES = {  # name: least size in bytes
    "session.bag": 50 * MEGABYTE, "summary.md": 1000, "summary.html": 5000, "summary.json": 1000, "report.html": 50000,
    "frf.png": 10000, "chart.png": 10000, "force.png": 10000,
}
PNG = b"\x89PNG\r\n\x1a\n"


def files(folder):
    for name, least in FILES.items():
        path = folder / name
        if not path.is_file():
            yield f"{path}: not found"
        elif path.stat().st_size < least:
            yield f"{path}: {path.stat().st_size} bytes, expected at least {least}"
        elif path.suffix == ".png" and path.read_bytes()[:8] != PNG:
            yield f"{path}: expected a PNG picture"


def targets(folder):
    path = folder / "summary.json"
    if not path.is_file():
        return
    summary = json.loads(path.read_text(encoding="utf-8"))
    if not summary["targets"] or summary["targets_met"] != summary["targets"]:
        yield f"{path}: {summary['targets_met']} of {summary['targets']} targets met"
    for figure in summary["figures"]:
        if "met" in figure and figure["met"] is not True:
            yield f"{path}: {figure['quantity']}: {'not checked' if figure['met'] is None else 'missed'}"


def discovery(folder):
    path = folder / "discovery" / "discovery.json"
    if not path.is_file():
        yield f"{path}: not found"
        return
    found = json.loads(path.read_text(encoding="utf-8"))
    if found["verdict"] != "explained":
        yield f"{path}: verdict {found['verdict']}, expected explained"


def main():
    folder = pathlib.Path(sys.argv[1])
    faults = [*files(folder), *targets(folder), *discovery(folder)]
    for fault in faults:
        print(fault)
    print(f"results: {len(faults)} faults" if faults else "results: complete, every target met")
    return 1 if faults else 0


sys.exit(main())
