#!/usr/bin/env python3
"""Counts the test cases in a folder of JUnit files and prints `N passed, N failed`."""
import pathlib
import sys
import xml.etree.ElementTree as ElementTree


def main():
    passed = failed = 0
    for path in sorted(pathlib.Path(sys.argv[1]).rglob("*.xml")):
        if path.name.startswith("rostest-"):  # wraps the gtest that writes a file of its own
            continue
        for case in ElementTree.parse(path).getroot().iter("testcase"):
            if case.find("failure") is not None or case.find("error") is not None:
                failed += 1
                print(f"failed: {case.get('classname')}.{case.get('name')}")
            else:
                passed += 1
    ctest_exit = int(sys.argv[2])
    if ctest_exit != 0 and failed == 0:
        failed = 1  # a test program that ended without a report
    print(f"{passed} passed, {failed} failed")
    return 1 if failed or passed == 0 else 0


sys.exit(main())
