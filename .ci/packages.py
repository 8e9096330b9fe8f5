"""Shared by the checks: the packages of this repository, their sources, includes and declared dependencies."""
import pathlib
import re
import subprocess
import xml.etree.ElementTree as ElementTree

ROOT = pathlib.Path(__file__).resolve().parent.parent
CODE = {".cpp", ".h"}
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', re.MULTILINE)


def tracked():
    """Paths of all files that git tracks or would add, relative to the root of the repository."""
    names = subprocess.run(["git", "-C", ROOT, "ls-files", "--cached", "--others", "--exclude-standard"],
                           check=True, capture_output=True, text=True).stdout.split("\n")
    return [pathlib.Path(n) for n in names if n and (ROOT / n).is_file()]


class Package:
    def __init__(self, folder, files):
        self.folder = folder
        self.files = [f for f in files if folder in f.parents]
        manifest = ElementTree.parse(ROOT / folder / "package.xml").getroot()
        self.name = manifest.findtext("name")
        self.declared = {e.tag: set() for e in manifest}
        for element in manifest:
            self.declared[element.tag].add((element.text or "").strip())

    def code(self):
        return [f for f in self.files if f.suffix in CODE]

    def declares(self, *tags):
        return set().union(*(self.declared.get(tag, set()) for tag in tags))


def packages():
    files = tracked()
    return [Package(f.parent, files) for f in files if f.name == "package.xml"]


def text(path):
    return (ROOT / path).read_text(encoding="utf-8")


def includes(path):
    return INCLUDE.findall(text(path))


def system_includes(path):
    """Headers of folders in angle brackets."""
    return [h for h in re.findall(r"^\s*#\s*include\s*<([^>]+)>", text(path), re.MULTILINE) if "/" in h]


def report(name, faults):
    """Prints the faults and returns the exit code."""
    for fault in faults:
        print(fault)
    print(f"{name}: {len(faults)} faults" if faults else f"{name}: good")
    return 1 if faults else 0
