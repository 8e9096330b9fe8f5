#!/usr/bin/env python3
"""Holds sources to .clang-tidy. What was good before and has not changed (nor a header of the project that it reads, nor
the checks) is not read again: CACHE remembers it.

usage: tidy.py [FOLDER...]   sources under these folders; none: all
"""
import collections
import concurrent.futures
import hashlib
import json
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUILD = ROOT / "build"
CACHE = pathlib.Path(os.environ.get("XDG_CACHE_HOME", pathlib.Path.home() / ".cache")) / "smartmill_tidy"


def dependencies():
    """What ninja knows: the files of the project that each source was compiled from."""
    reads = collections.defaultdict(set)
    for block in subprocess.run(["ninja", "-C", BUILD, "-t", "deps"], capture_output=True, text=True,
                                check=True).stdout.split("\n\n"):
        files = [(BUILD / line.strip()).resolve() for line in block.split("\n")[1:] if line.strip()]
        ours = [f for f in files if ROOT in f.parents and BUILD not in f.parents]
        for source in ours:
            if source.suffix == ".cpp":
                reads[source].update(ours)
    return reads


def fingerprint(source, files):
    state = hashlib.sha256(subprocess.run(["clang-tidy", "--version"], capture_output=True, check=True).stdout)
    for path in [ROOT / ".clang-tidy", source, *sorted(files)]:
        if path.exists():
            state.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return state.hexdigest()


def check(source, files):
    """What clang-tidy says of a source; empty: it is good."""
    good = CACHE / fingerprint(source, files)
    if good.exists():
        return ""
    run = subprocess.run(["clang-tidy", "-p", BUILD, "--quiet", source], capture_output=True, text=True, check=False)
    if run.returncode == 0:
        CACHE.mkdir(parents=True, exist_ok=True)
        good.touch()
        return ""
    return run.stdout.strip() or run.stderr.strip()


def main():
    folders = [(ROOT / f).resolve() for f in sys.argv[1:]] or [ROOT]
    reads = dependencies()
    sources = {pathlib.Path(entry["file"]).resolve() for entry in json.loads((BUILD / "compile_commands.json").read_text())}
    sources = sorted(s for s in sources if ROOT in s.parents and BUILD not in s.parents
                     and any(f == s or f in s.parents for f in folders))
    bad = 0
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for said in pool.map(lambda s: check(s, reads[s]), sources):
            if said:
                bad += 1
                print(said)
    print(f"clang-tidy: {bad} of {len(sources)} sources are not good" if bad else
          f"clang-tidy: good, {len(sources)} sources")
    return 1 if bad else 0


sys.exit(main())
