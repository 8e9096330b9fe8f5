"""Runs the tests of a module and writes their results as JUnit XML.

usage: junit.py MODULE FILE
"""
import pathlib
import sys
import unittest
import xml.etree.ElementTree as ElementTree


class Result(unittest.TextTestResult):
    """Keeps the tests that were started."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.started = []

    def startTest(self, test):
        super().startTest(test)
        self.started.append(test)


def main():
    module, file = sys.argv[1:]
    sys.path.insert(0, str(pathlib.Path(__file__).parent))
    result = unittest.TextTestRunner(resultclass=Result, verbosity=2).run(
        unittest.defaultTestLoader.loadTestsFromName(module))
    cases = {test.id(): [] for test in result.started}
    for kind, found in (("failure", result.failures), ("error", result.errors), ("skipped", result.skipped)):
        for test, text in found:  # a class that fails or is skipped as a whole has started no test
            cases.setdefault(test.id(), []).append((kind, text))
    suite = ElementTree.Element("testsuite", name=module, tests=str(len(cases)))
    for name, outcomes in cases.items():
        classname, _, method = name.rpartition(".")
        case = ElementTree.SubElement(suite, "testcase", classname=classname, name=method)
        for kind, text in outcomes:
            ElementTree.SubElement(case, kind, message=text.strip().splitlines()[-1]).text = text
    pathlib.Path(file).parent.mkdir(parents=True, exist_ok=True)
    ElementTree.ElementTree(suite).write(file, encoding="utf-8", xml_declaration=True)
    return 0 if result.wasSuccessful() and cases else 1


if __name__ == "__main__":
    sys.exit(main())
