#!/usr/bin/env python3
"""Counts the test cases in a folder of JUnit files; the last line is `N passed, N failed, N skipped`.

usage: count_tests.py RESULTS CTEST_EXIT_CODE [--refuse-skipped]
"""
import pathlib
import sys
import xml.etree.ElementTree as ElementTree

# What needs packages that are optional (./setup --with-linuxcnc, --with-fleet, --with-instruments, --with-docs; open62541, which Debian 12 lacks)
# may be skipped everywhere.
OPTIONAL = ("LinuxCncMachine", "FleetDatabase", "FleetMessage", "Sound", "SoundDriver", "SigrokDriver", "IioDriver", "ComediDriver", "StudiesEngine", "site_test.SiteTest", "OpcUaServer", "OpcUaNodeTest",
            "graph_tutorials_test.LinuxCncTutorialTest")


def verdict(case):
    """failed, skipped or passed: of one testcase element as GoogleTest or rosunit writes it."""
    if case.find("failure") is not None or case.find("error") is not None:
        return "failed"
    if case.find("skipped") is not None or case.get("result") in ("skipped", "suppressed"):
        return "skipped"
    return "passed"


def reasons(case):
    """First lines of each failure of a testcase."""
    for failure in [*case.findall("failure"), *case.findall("error")]:
        text = failure.get("message") or failure.text or ""
        yield from ("  " + line.strip() for line in text.strip().splitlines()[:6])


def main():
    count = {"passed": 0, "failed": 0, "skipped": 0}
    refused = 0
    for path in sorted(pathlib.Path(sys.argv[1]).rglob("*.xml")):
        if path.name.startswith("rostest-"):  # wraps the gtest that writes a file of its own
            continue
        for case in ElementTree.parse(path).getroot().iter("testcase"):
            count[verdict(case)] += 1
            refused += verdict(case) == "skipped" and case.get("classname") not in OPTIONAL
            if verdict(case) != "passed":
                print(f"{verdict(case)}: {case.get('classname')}.{case.get('name')}")
                print(*reasons(case), sep="\n", end="\n" if verdict(case) == "failed" else "")
    if int(sys.argv[2]) != 0 and count["failed"] == 0:
        print("failed: a test program that ended without a report")
        count["failed"] = 1
    print(", ".join(f"{number} {name}" for name, number in count.items()))
    refused = "--refuse-skipped" in sys.argv and refused
    return 1 if count["failed"] or count["passed"] == 0 or refused else 0


sys.exit(main())
