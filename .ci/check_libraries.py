#!/usr/bin/env python3
"""Lists the Debian packages whose libraries the built programs load: version, waiting update, and known vulnerabilities.

usage: .ci/check_libraries.py [--tracker FILE] [--programs FOLDER]
--tracker: the data of Debian's security tracker (its page data/json, downloaded by hand: this program connects to nothing)

Exit code 1: an update from a security archive waits, or the tracker lists an open vulnerability of medium or high urgency.
"""
import argparse
import collections
import json
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
SEVERE = {"medium", "high"}


def output(*command):
    environment = dict(os.environ, LC_ALL="C", LD_LIBRARY_PATH=str(ROOT / "devel/lib"))
    return subprocess.run(command, capture_output=True, text=True, env=environment, check=False).stdout


def loaded(folder):
    """@return files of the libraries outside the folder that its programs load"""
    programs = [str(path) for path in sorted(folder.rglob("*")) if path.is_file() and (os.access(path, os.X_OK) or ".so" in path.name)]
    files = set()
    for begin in range(0, len(programs), 100):
        for line in output("ldd", *programs[begin:begin + 100]).splitlines():
            if "=> /" in line:
                files.add(os.path.realpath(line.split("=> ")[1].split(" (")[0]))
    return {file for file in files if not file.startswith(str(folder))}


def packages(files):
    """@return {binary package: (version, source package, version of the source)}"""
    # dpkg lists files as they were unpacked, with /lib where that is a link to /usr/lib now.
    names = sorted(files | {file.removeprefix("/usr") for file in files})
    owners = {line.split(": ")[0].split(",")[0] for line in output("dpkg", "-S", *names).splitlines() if ": /" in line}
    found = {}
    for line in output("dpkg-query", "-W", "-f", "${binary:Package} ${Version} ${source:Package} ${source:Version}\n", *sorted(owners)).splitlines():
        name, version, source, source_version = line.split()
        found[name] = (version, source, source_version)
    return found


def updates(names):
    """@return {binary package: (candidate, from a security archive)} where it is newer than what is installed"""
    waiting, name, installed = {}, "", ""
    lines = output("apt-cache", "policy", *names).splitlines()
    for k, line in enumerate(lines):
        if not line.startswith(" "):
            name = line.rstrip(":")
        elif line.startswith("  Installed:"):
            installed = line.split()[1]
        elif line.startswith("  Candidate:") and line.split()[1] not in (installed, "(none)"):
            candidate = line.split()[1]
            origin = " ".join(lines[k:k + 8])
            waiting[name] = (candidate, "security" in origin)
    return waiting


def vulnerabilities(tracker, release, found):
    """@return {source: [(CVE, urgency)]} that are open in the release"""
    data = json.loads(pathlib.Path(tracker).read_text())
    opened = collections.defaultdict(list)
    for source in sorted({source for _, source, _ in found.values()}):
        for name, entry in data.get(source, {}).items():
            state = entry.get("releases", {}).get(release, {})
            if state.get("status") == "open":
                opened[source].append((name, state.get("urgency", "not yet assigned")))
    return opened


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--tracker")
    parser.add_argument("--programs", type=pathlib.Path, default=ROOT / "devel")
    arguments = parser.parse_args()
    files = loaded(arguments.programs)
    if not files:
        sys.exit(f"check_libraries: {arguments.programs}: no programs, expected a build")
    found = packages(files)
    waiting = updates(sorted(found))
    release = dict(line.split("=", 1) for line in pathlib.Path("/etc/os-release").read_text().splitlines() if "=" in line).get("VERSION_CODENAME", "")
    opened = vulnerabilities(arguments.tracker, release, found) if arguments.tracker else {}
    for name, (version, source, _) in sorted(found.items()):
        notes = []
        if name in waiting:
            notes.append(f"{'security ' if waiting[name][1] else ''}update {waiting[name][0]}")
        notes += [f"{cve} ({urgency})" for cve, urgency in opened.get(source, [])]
        print(f"{name:32} {version:32} {'; '.join(notes)}".rstrip())
    severe = sum(urgency in SEVERE for entries in opened.values() for _, urgency in entries)
    security = sum(is_security for _, is_security in waiting.values())
    known = f"{sum(map(len, opened.values()))} open vulnerabilities, {severe} of them of medium or high urgency" if arguments.tracker else \
        "vulnerabilities not looked up (--tracker)"
    print(f"{len(found)} packages of {release}, {len(waiting)} updates, {security} of them from a security archive; {known}")
    return 1 if security or severe else 0


if __name__ == "__main__":
    sys.exit(main())
