#!/usr/bin/env python3
"""Compares the libraries that the built programs link (objdump, NEEDED) with the table in docs/licences.md, for each Debian package.

usage: check_licences.py [DEVEL]    devel space of a tree that is built (default devel)
"""
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
DOCUMENT = ROOT / "docs" / "licences.md"
COMPILER = re.compile(r"lib(c|m|stdc\+\+|gcc_s|pthread|dl|rt)\.so|ld-linux")
OPTIONAL = {"linuxcnc_gateway", "linuxcnc_stream"}  # built only where LinuxCNC is installed, in no package
ROS = {"librosconsole", "libroscpp", "librostime"}  # what links these is in smartmill-ros


def table():
    """(library, package) of each row | `LIBRARY`, `LIBRARY` | Debian package | licence | `PACKAGE`, `PACKAGE` |."""
    found = set()
    for line in DOCUMENT.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| `lib") and len(cells) == 4:
            found |= {(library, package) for library in re.findall(r"`(\S+?)`", cells[0]) for package in re.findall(r"`(\S+?)`", cells[3])}
    return found


def needed(path):
    text = subprocess.run(["objdump", "-p", path], capture_output=True, text=True, check=False).stdout
    return {name.split(".so")[0] for name in re.findall(r"NEEDED +(\S+)", text) if not COMPILER.match(name)}


def package_of(path, libraries):
    """Debian package (debian/*.install) of a file of the devel space; none: it is in no package."""
    if path.name in OPTIONAL:
        return None
    if "studies" in str(path) or "testing" in path.name or path.stem.endswith("_test"):
        return None
    if "smartmill_panel" in str(path):
        return "smartmill-panel"
    if path.suffixes[:1] == [".so"] and "python" not in str(path):
        return "smartmill-ros" if ROS & libraries else "smartmill"
    if "python" in str(path):
        return "python3-smartmill"
    return "smartmill" if path.parent.name == "bin" else "smartmill-ros"


def main():
    devel = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "devel")
    files = [*devel.glob("lib/libsmartmill_*.so"), *devel.glob("lib/smartmill_*/*"), devel / "bin" / "smartmill",
             *devel.glob("lib/python3/dist-packages/smartmill/*.so")]
    linked = {}
    for path in files:
        libraries = needed(path)
        package = package_of(path, libraries)
        for library in libraries:
            if package and not library.startswith("libsmartmill_"):
                linked.setdefault((library, package), path)
    if not linked:
        sys.exit(f"{devel}: no built library found; build first (./setup)")
    known = table()
    faults = [f"{path}: {package} links {library}, which has no such row" for (library, package), path in linked.items()
              if (library, package) not in known]
    # Debian 12 links Ceres statically, with what it needs, Debian 13 as a library; PostgreSQL and the
    # libraries of instruments are optional in a build tree.
    faults += [f"{library}: nothing in {package} links it" for library, package in known - set(linked)
               if library not in {"libceres", "libcholmod", "libcxsparse", "liblapack", "libf77blas", "libpq", "libpulse", "libsigrok",
                                     "libglib-2.0", "libiio", "libcomedi"}]
    for fault in sorted(faults):
        print(f"docs/licences.md: {fault}")
    print(f"licences: {len(faults)} faults, {len(linked)} links")
    return 1 if faults else 0


sys.exit(main())
