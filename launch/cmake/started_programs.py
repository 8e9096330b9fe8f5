#!/usr/bin/env python3
"""CMake targets of the programs that a script starts: nodes of its roslaunch calls, with arguments and includes
resolved by roslaunch, its rosrun calls, and the program of the offline tools.

usage: started_programs.py SCRIPT WORKSPACE [--only FILE.launch | --without FILE.launch]
"""
import argparse
import os
import pathlib
import re
import sys

ROSLAUNCH = re.compile(r"\broslaunch\b.*?\bsmartmill_launch\s+(\S+\.launch)([^>|&]*)")
ROSRUN = re.compile(r"\brosrun\s+(smartmill_\w+)\s+(\w+)")
TOOL_PROGRAM = "smartmill"  # what launch/src/session/child.h starts as `smartmill`


def target(package, program):
    """Name of a target of smartmill_executable()."""
    return f"{package}_{program}"


def nodes(launch_file, arguments):
    """Targets of the nodes of this project that a launch file starts with these arguments."""
    import roslaunch.config
    import roslaunch.xmlloader
    config = roslaunch.config.ROSLaunchConfig()
    roslaunch.xmlloader.XmlLoader(resolve_anon=False).load(str(launch_file), config, argv=arguments, verbose=False)
    return {target(n.package, n.type) for n in config.nodes if n.package.startswith("smartmill_")}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("script", type=pathlib.Path)
    parser.add_argument("workspace", type=pathlib.Path)
    group = parser.add_mutually_exclusive_group()
    group.add_argument("--only", help="this launch file alone")
    group.add_argument("--without", help="all but this launch file")
    options = parser.parse_args()
    os.environ["ROS_PACKAGE_PATH"] = str(options.workspace)
    text = options.script.read_text(encoding="utf-8").replace("\\\n", " ")
    text = re.sub(r"^\s*#.*$", "", text, flags=re.MULTILINE)
    found = set()
    for name, rest in ROSLAUNCH.findall(text):
        if options.only not in (None, name) or options.without == name:
            continue
        # Shell variables are replaced by a value that is not empty.
        arguments = [re.sub(r'"|\$\w+', "x", word) for word in rest.split() if ":=" in word]
        arguments = [re.sub(r"^port:=.*", "port:=1", word) for word in arguments]
        found |= nodes(options.workspace / "launch" / "launch" / name, arguments)
    if not options.only:
        found |= {target(*call) for call in ROSRUN.findall(text)} | {TOOL_PROGRAM}
    if not found:
        sys.exit(f"{options.script}: expected roslaunch or rosrun calls of smartmill packages, found none")
    print(";".join(sorted(found)))


main()
