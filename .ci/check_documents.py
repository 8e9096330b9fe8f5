#!/usr/bin/env python3
"""Holds the documents against the tree: every program, launch file, test and linked file that they name exists."""
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent


def packages():
    """Name of each package and its folder."""
    found = {}
    for path in ROOT.glob("**/package.xml"):
        relative = path.relative_to(ROOT)
        if relative.parts[0] not in ("build", "build_sanitized", "devel"):
            found[re.search(r"<name>(.*?)</name>", path.read_text()).group(1)] = path.parent
    return found


def programs(folder):
    """Names that rosrun finds in a package."""
    names = {path.stem for path in folder.glob("apps/*.cpp")}
    names |= {f"{path.parent.parent.name}_{path.stem}" for path in folder.glob("*/apps/*.cpp")}
    for cmake in folder.glob("**/CMakeLists.txt"):
        text = cmake.read_text()
        names |= set(re.findall(r"smartmill_executable\((\w+)", text))
        names |= set(re.findall(r"OUTPUT_NAME (\w+)", text))
    return names


def tests(folders):
    names = set()
    for name, folder in folders.items():
        names |= {f"{name}_{path.stem}" for path in folder.glob("**/*_test.cpp")}
        for cmake in folder.glob("**/CMakeLists.txt"):
            for test in re.findall(r"smartmill_(?:gtest|rostest)\((?:\S+\.test )?(\w+)", cmake.read_text()):
                names.add(f"{name}_{test}")
    return names


def stands(path, folders):
    """Whether a file of the tree, or a public header, has this path."""
    roots = [ROOT, *folders.values(), *(f / "include" for f in folders.values())]
    return any((root / path).exists() for root in roots)


def faults(document, folders, known_tests):
    text = document.read_text()
    for path in set(re.findall(r"`((?:src/)?(?:smartmill_|launch/)[\w/.]+\.(?:h|cpp|yaml|launch))`", text)):
        if "/" in path and not stands(path, folders):
            yield f"{path}: there is no such file"
    for package, program in re.findall(r"rosrun (smartmill_\w+) (\w+)", text):
        if package not in folders or program not in programs(folders[package]):
            yield f"rosrun {package} {program}: there is no such program"
    for package, file in re.findall(r"roslaunch (smartmill_\w+) (\w+\.launch)", text):
        if package not in folders or not list(folders[package].glob(f"**/{file}")):
            yield f"roslaunch {package} {file}: there is no such file"
    for test in set(re.findall(r"`(smartmill_\w+_test)\b", text)):
        if test not in known_tests:
            yield f"{test}: there is no such test"
    for link in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", text):
        if not (document.parent / link).exists():
            yield f"{link}: there is no such file"
    for number in re.findall(r"\bissues? \d+", text, re.IGNORECASE):
        yield f"{number}: a reader cannot open it"


def main():
    folders = packages()
    known_tests = tests(folders)
    names = subprocess.run(["git", "-C", ROOT, "ls-files", "*.md"], check=True, capture_output=True, text=True)
    count = 0
    for name in names.stdout.split():
        for fault in faults(ROOT / name, folders, known_tests):
            print(f"{name}: {fault}")
            count += 1
    print(f"documents: {len(names.stdout.split())} read, {count} faults")
    return 1 if count else 0


sys.exit(main())
