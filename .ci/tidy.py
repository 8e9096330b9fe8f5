#!/usr/bin/env python3
"""Runs clang-tidy with the checks of .clang-tidy. A source that passed is skipped until it, a header of the project that it includes, or
the checks change (CACHE). Needs a built tree, whose dependency files list the includes of each source.

usage: tidy.py [--minutes N] [FOLDER...]   all sources under these folders; none: those of the libraries and programs
without ROS. Node sources are left out, since the ROS headers cost 10 s each; tests and studies would double the time.
"""
import argparse
import collections
import concurrent.futures
import hashlib
import json
import os
import pathlib
import re
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUILD = ROOT / "build"
CACHE = pathlib.Path(os.environ.get("XDG_CACHE_HOME", pathlib.Path.home() / ".cache")) / "smartmill_tidy"
# clang cannot read headers precompiled by gcc; a source must compile without them.
PRECOMPILED = re.compile(r" -Winvalid-pch| -include \S*cmake_pch\.hxx")
ROS = pathlib.Path("/usr/include/ros")
OUT_OF_TIME = 124  # exit code, as that of timeout
VERSION = subprocess.run(["clang-tidy", "--version"], capture_output=True, check=True).stdout


def dependencies():
    """From ninja: the files of the project that each source includes, and the sources that include ROS."""
    reads, shells = collections.defaultdict(set), set()
    for block in subprocess.run(["ninja", "-C", BUILD, "-t", "deps"], capture_output=True, text=True,
                                check=True).stdout.split("\n\n"):
        files = [(BUILD / line.strip()).resolve() for line in block.split("\n")[1:] if line.strip()]
        ours = [f for f in files if ROOT in f.parents and BUILD not in f.parents and ROOT / "devel" not in f.parents]
        for source in ours:
            if source.suffix == ".cpp":
                reads[source].update(ours)
                if any(ROS in f.parents for f in files):
                    shells.add(source)
    return reads, shells


def is_selected(source, folders, shells):
    if folders:
        return any(f == source or f in source.parents for f in folders)
    parts = source.relative_to(ROOT).parts
    return source not in shells and not {"test", "testing", "smartmill_studies"}.intersection(parts)


def commands():
    """How each source of the project is compiled; one that several targets share: as in the first."""
    found = {}
    for entry in json.loads((BUILD / "compile_commands.json").read_text()):
        source = pathlib.Path(entry["file"]).resolve()
        if ROOT in source.parents and BUILD not in source.parents:
            found.setdefault(source, {**entry, "command": PRECOMPILED.sub("", entry["command"])})
    return found


def fingerprint(source, command, files):
    state = hashlib.sha256(VERSION + command.replace(str(ROOT), "").encode())
    for path in [ROOT / ".clang-tidy", *sorted(files | {source})]:
        if path.exists():
            state.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return state.hexdigest()


def check(folder, source, good):
    """Output of clang-tidy for a source; empty: no findings."""
    run = subprocess.run(["clang-tidy", "-p", folder, "--quiet", source], capture_output=True, text=True, check=False)
    if run.returncode == 0:
        good.touch()
        return ""
    return run.stdout.strip() or run.stderr.strip()


def findings(output):
    """Each finding with its explaining lines; a finding in a header occurs once for every source that includes it."""
    return re.split(r"\n(?=/\S+:\d+:\d+: (?:error|warning): )", output)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="*")
    parser.add_argument("--minutes", type=float, default=float("inf"),
                        help="no source is started after this time; unchecked sources are counted, exit code 124")
    arguments = parser.parse_args()
    end = time.monotonic() + 60.0 * arguments.minutes
    folders = [(ROOT / f).resolve() for f in arguments.folders]
    reads, shells = dependencies()
    todo, count = [], 0
    CACHE.mkdir(parents=True, exist_ok=True)
    database = BUILD / "tidy"
    database.mkdir(exist_ok=True)
    entries = commands()
    (database / "compile_commands.json").write_text(json.dumps(list(entries.values())))
    for source, entry in sorted(entries.items()):
        if source.suffix != ".cpp" or not is_selected(source, folders, shells):
            continue
        count += 1
        if source not in reads:
            sys.exit(f"clang-tidy: {source.relative_to(ROOT)} is not built: run ./setup before")
        good = CACHE / fingerprint(source, entry["command"], reads[source])
        if not good.exists():
            todo.append((source, good))
    printed, bad, late = set(), 0, 0
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for output in pool.map(lambda job: check(database, *job) if time.monotonic() < end else None, todo):
            late += output is None
            bad += bool(output)
            for finding in findings(output or ""):
                if finding not in printed:
                    print(finding, flush=True)
                    printed.add(finding)
    print(f"clang-tidy: {f'findings in {bad} sources' if bad else 'good'}; {count} sources, {count - len(todo)} "
          f"unchanged since they passed, {late} not checked in time")
    return 1 if bad else OUT_OF_TIME if late else 0


sys.exit(main())
