#!/usr/bin/env python3
"""Checks the documents: every program, launch file, test and linked file that they name exists, their walks through the code are true, and
results.md is made from valid records."""
import pathlib
import re
import subprocess
import sys

import walks

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
        names |= set(re.findall(r"install\(PROGRAMS scripts/(\w+)", text))
    return names


def tests(folders):
    names = set()
    for name, folder in folders.items():
        names |= {f"{name}_{path.stem}" for path in folder.glob("**/*_test.cpp")}
        for cmake in folder.glob("**/CMakeLists.txt"):
            for test in re.findall(r"smartmill_(?:gtest|rostest)\((?:\S+\.test )?(\w+)", cmake.read_text()):
                names.add(f"{name}_{test}")
    return names


def find(path, folders):
    """The file of the tree, or the public header, with this path; empty: none."""
    roots = [ROOT, *folders.values(), *(f / "include" for f in folders.values())]
    return next((root / path for root in roots if (root / path).exists()), None)


def anchors(document):
    """Identifiers of the sections of a document."""
    text = document.read_text()
    headings = re.findall(r"^#+ +(.*)$", text, re.MULTILINE)
    return set(re.findall(r'<a id="([^"]+)">', text)) | {re.sub(r"[^\w\s-]", "", heading).strip().lower().replace(" ", "-") for heading in headings}


def faults(document, folders, known_tests):
    text = document.read_text()
    for path in set(re.findall(r"`((?:src/)?(?:smartmill_|launch/)[\w/.]+\.(?:h|cpp|yaml|launch))`", text)):
        if "/" in path and not find(path, folders):
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
    for link, _, section in re.findall(r"\]\(([^)#:]*)(#([^)]*))?\)", text):
        linked = document.parent / link if link else document
        if not linked.exists():
            yield f"{link}: there is no such file"
        elif section and linked.suffix == ".md" and section not in anchors(linked):
            yield f"{link}#{section}: there is no such section"
    for number in re.findall(r"\bissues? \d+", text, re.IGNORECASE):
        yield f"{number}: a reader cannot open it"


def picture_faults():
    """Names of functions and classes in the picture of the architecture are those of the text."""
    text = " ".join(re.findall(r">([^<>\n]+)<", (ROOT / "docs/architecture.svg").read_text()))
    text = text.replace("- ", "").replace(" ::", "::")
    document = (ROOT / "docs/architecture.md").read_text()
    for name in sorted(set(re.findall(r"\b[A-Za-z][a-z0-9]+[A-Z]\w*(?:::\w+)?", text))):
        if name not in document:
            yield f"{name} is not in architecture.md"


# Numbers of the last equation, figure and table of each chapter of the five documents (0: numbered without chapters).
# Burzoni: numbers of his list of figures, not of his captions.
NUMBERED = {
    "Dunwoody": {"equations": {2: 4, 3: 23, 4: 44, 5: 68, 6: 14, 7: 1},
                 "figures": {2: 1, 3: 5, 4: 8, 5: 9, 6: 3}, "tables": {}},
    "Kim": {"equations": {0: 16}, "figures": {0: 7}, "tables": {}},
    "Burzoni": {"equations": {1: 2, 2: 7, 3: 7, 4: 55, 5: 55, 6: 4}, "figures": {0: 57}, "tables": {0: 15}},
    "Bachrathy": {"equations": {2: 7}, "figures": {0: 5}, "tables": {1: 1}},
    "Cheng": {"equations": {0: 3}, "figures": {0: 6}, "tables": {0: 2}},
}


def spread(text):
    """The numbers of "3.6..3.8, 3.11" or "4-1..4-27" as (chapter, number); chapter 0 where there is none."""
    found = set()
    for first, last in re.findall(r"(\d+(?:[.-]\d+)?)(?:\.\.(\d+(?:[.-]\d+)?))?(?![\d.-])", text):
        low = [int(n) for n in re.split("[.-]", first)]
        high = [int(n) for n in re.split("[.-]", last)] if last else low
        found |= {(low[0] if len(low) > 1 else 0, n) for n in range(low[-1], high[-1] + 1)}
    return found


def listed(section):
    """Numbers in the first column of a document's table, by kind."""
    found = {"equations": set(), "figures": set(), "tables": set()}
    for cell in re.findall(r"^\| ([^|]*) \|", section, re.M):
        kind = "equations"
        for part in re.split(r"\b(figures?|tables?)\b", re.sub(r"\([^)]*\)", "", cell)):
            if re.fullmatch(r"figures?|tables?", part):
                kind = part.rstrip("s") + "s"
            else:
                found[kind] |= spread(part)
    return found


def seed_faults(folders):
    """docs/seeds.md lists every number of the documents, and only files and figures that exist."""
    text = (ROOT / "docs/seeds.md").read_text()
    for section in re.split(r"\n## ", text)[1:]:
        name = re.match(r"\w+", section).group(0)
        if section.startswith("Errors of the documents\n"):
            continue
        found = listed(section)
        for kind, chapters in NUMBERED[name].items():
            expected = {(chapter, n) for chapter, last in chapters.items() for n in range(1, last + 1)}
            for chapter, n in sorted(expected - found[kind]):
                yield f"{name}: {kind[:-1]} {f'{chapter}.{n}' if chapter else n} is missing"
    gallery = "".join(p.read_text() for p in sorted((ROOT / "smartmill_studies/gallery").glob("*.cpp")))
    figures = set(re.findall(r'"((?:dunwoody|kim|burzoni|bachrathy|cheng)_\w+)"', gallery))
    for names in re.findall(r"gallery --only ((?:[a-z]+_\w+ ?)+)", text):
        for name in set(names.split()) - figures:
            if not (name.startswith("burzoni_table_") and 8 <= int(name.rsplit("_", 1)[1]) <= 15):
                yield f"gallery --only {name}: there is no such figure"
    roots = [f for f in folders["smartmill_studies"].glob("**/*.h")]
    for header in set(re.findall(r"`(\w+\.h)`", text)):
        if not any(path.name == header for path in roots) and not list(ROOT.glob(f"*/test/**/{header}")):
            yield f"{header}: there is no such file"


def main():
    folders = packages()
    known_tests = tests(folders)
    names = subprocess.run(["git", "-C", ROOT, "ls-files", "*.md"], check=True, capture_output=True, text=True)
    count = claims = 0
    for name in names.stdout.split():
        wrong, checked = walks.faults((ROOT / name).read_text(), lambda path: find(path, folders))
        claims += checked
        for fault in [*faults(ROOT / name, folders, known_tests), *wrong]:
            print(f"{name}: {fault}")
            count += 1
    for name, found in (("seeds.md", seed_faults(folders)), ("architecture.svg", picture_faults())):
        for fault in found:
            print(f"docs/{name}: {fault}")
            count += 1
    results = subprocess.run([ROOT / "docs/site/results_page.py", "--check"], capture_output=True, text=True)
    if results.returncode:
        print(results.stderr, end="")
        count += 1
    print(f"documents: {len(names.stdout.split())} read, {claims} claims of walks checked, {count} faults")
    return 1 if count else 0


sys.exit(main())
