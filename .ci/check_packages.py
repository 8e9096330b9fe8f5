#!/usr/bin/env python3
"""Dependency rules: the core, the FOCAS wire, the recordings and the libraries of the node packages include no ROS header; no node
package includes headers of another. All exceptions are listed in this file."""
import pathlib
import re
import sys

from packages import includes, packages, report, text

ROS = re.compile(r"(ros|rosbag|roslib|actionlib|tf2|tf2_\w+|diagnostic_updater|topic_tools|smartmill_ros|\w+_msgs)/")
ROS_FREE = {"smartmill_core", "smartmill_focas", "smartmill_recording"}
SHELLS = {"smartmill_ros", "smartmill_msgs"}  # ROS everywhere
COMMON = {"smartmill_core", "smartmill_focas", "smartmill_recording", "smartmill_ros", "smartmill_msgs"}
MAY_INCLUDE = {
    "smartmill_core": set(),
    "smartmill_focas": set(),
    "smartmill_recording": {"smartmill_core"},
    "smartmill_ros": {"smartmill_core", "smartmill_recording", "smartmill_msgs"},
    "smartmill_discrepancy": COMMON | {"smartmill_sim", "smartmill_program"},  # runs the twin; follows a program in a record
    "smartmill_program": COMMON | {"smartmill_stability"},  # limits of a program's engagements
    "smartmill_studies": None,  # every library
    "smartmill_cli": None,  # the commands of every library
    "smartmill_python": None,  # every library
}
ROS_FOLDERS = {"node", "apps", "test"}
ROS_SOURCES = ("launch/src/session/",)  # sources of programs only
# In the folder node, but included by offline tools too.
ROS_FREE_FILES = {"parameters.h", "monitor_parameters.h", "rotation.h", "wiring.h"}


def may_use_ros(package, path):
    if package.name in ROS_FREE:
        return False
    if package.name in SHELLS or str(path).startswith(ROS_SOURCES):
        return True
    parts = path.relative_to(package.folder).parts
    if parts[:2] == ("src", "node") and path.name in ROS_FREE_FILES:
        return False
    return parts[0] != "include" and bool(ROS_FOLDERS.intersection(parts[:-1]))


EFFECTS = pathlib.Path("src/smartmill_core/src/effects")


def faults_of_effects(paths):
    """Each file is one effect: it defines the function of its name and includes nothing but the core and the vocabulary of effects."""
    for path in paths:
        first, *words = path.stem.split("_")
        name = first + "".join(word.capitalize() for word in words)
        if not re.search(rf"^EffectKind {name}\(\)", text(path), re.MULTILINE):
            yield f"{path}: expected a function EffectKind {name}()"
        for header in includes(path):
            if "/" in header and header != "model/effect_declaration.h" and not header.startswith("smartmill_core/"):
                yield f"{path}: {header}: an effect depends on the core only"


def main():
    faults = []
    everything = packages()
    names = {p.name for p in everything}
    for package in everything:
        allowed = MAY_INCLUDE.get(package.name, COMMON)
        for path in package.code():
            for header in includes(path):
                owner = header.split("/")[0]
                if ROS.match(header) and not may_use_ros(package, path):
                    faults.append(f"{path}: {header}: ROS headers are not allowed here")
                if owner in names and owner != package.name and allowed is not None and owner not in allowed:
                    faults.append(f"{path}: {header}: {package.name} must not depend on {owner}")
    faults += faults_of_effects(path for p in everything for path in p.code() if path.parent == EFFECTS)
    return report("dependency rules", faults)


sys.exit(main())
