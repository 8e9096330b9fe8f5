#!/usr/bin/env python3
"""Compares what ./run printed with the output that the first tutorial shows.

usage: check_first_run.py LOG
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs/test"))
import console

TUTORIAL = ROOT / "docs/tutorials/first_run.md"


def main():
    printed = re.sub(r"\x1b\[[0-9;]*m", "", pathlib.Path(sys.argv[1]).read_text(encoding="utf-8")).splitlines()
    expected = next(step.output for step in console.steps(TUTORIAL) if isinstance(step, console.Command) and step.text == "./run")
    fault = console.difference(expected, printed)
    print(f"{TUTORIAL.name}: {fault or 'as printed'}")
    return 1 if fault else 0


sys.exit(main())
