#!/usr/bin/env python3
"""Metrics of the sources: files and lines of each package, the longest functions, runs of lines that occur twice.

usage: metrics.py [FOLDER] [--long N] [--run N]
"""
import argparse
import collections
import pathlib
import re
import subprocess

CONTROL = re.compile(r"^\s*(if|for|while|switch|else|do|catch|try|namespace|class|struct|enum|union|extern)\b")


def sources(root):
    names = subprocess.run(["git", "-C", root, "ls-files", "*.cpp", "*.h"], check=True, capture_output=True, text=True)
    return sorted(root / name for name in names.stdout.splitlines() if (root / name).exists())


def package_of(root, path):
    for folder in path.parents:
        if (folder / "package.xml").exists():
            return folder.relative_to(root).as_posix()
    return "."


def without_text(text):
    """The same lines without comments and with empty literals."""
    pattern = r'//[^\n]*|/\*.*?\*/|R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|(?<![0-9a-fA-F])\'(?:\\.|[^\'\\\n])*\''
    return re.sub(pattern, lambda m: "\n" * m.group(0).count("\n"), text, flags=re.S)


def functions(text):
    """(name, first line, lines) of every function body: a block outside other functions whose head ends in a parameter list."""
    found, depth, open_at, head, line, head_line = [], 0, None, "", 1, 1
    stack = []
    for character in re.sub(r"^[ \t]*#.*$", "", without_text(text), flags=re.M):
        if character == "{":
            is_function = open_at is None and ")" in head and not CONTROL.match(head.strip() or " ") and "=" not in head.split(
                "(")[0]
            stack.append(is_function)
            if is_function:
                name = re.findall(r"([~\w:]+)\s*\(", head)
                open_at = (name[0] if name else "?", head_line, len(stack))
            head = ""
        elif character == "}":
            if stack:
                stack.pop()
                if open_at and len(stack) < open_at[2]:
                    found.append((open_at[0], open_at[1], line - open_at[1] + 1))
                    open_at = None
            head = ""
        elif character == ";":
            head = ""
        else:
            if not head.strip() and not character.isspace():
                head_line = line
            head += character
        if character == "\n":
            line += 1
    return found


def repeated(files, run):
    """Runs of `run` lines of code that occur in two places; overlapping runs of one pair of files are listed once."""
    places = collections.defaultdict(list)
    for path, text in files:
        lines = [re.sub(r"\s+", " ", l).strip() for l in without_text(text).split("\n")]
        code = [(n, l) for n, l in enumerate(lines, 1) if len(l) > 3 and not l.startswith("#include") and not l.startswith("using ")]
        for k in range(len(code) - run + 1):
            places[tuple(l for _, l in code[k:k + run])].append((path, code[k][0]))
    pairs = {}
    for where in places.values():
        for k, (path, first) in enumerate(where):
            for other, second in where[k + 1:]:
                pairs.setdefault((path, other), (first, second))
    return pairs


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", default=".")
    parser.add_argument("--long", type=int, default=60, help="functions with more lines than this are listed")
    parser.add_argument("--run", type=int, default=6, help="lines of a repeated run")
    arguments = parser.parse_args()
    root = pathlib.Path(arguments.folder).resolve()
    count, texts, long_ones = collections.defaultdict(lambda: [0, 0, 0]), [], []
    for path in sources(root):
        text = path.read_text(encoding="utf-8")
        row = count[package_of(root, path)]
        is_test = "test" in path.relative_to(root).parts
        row[0] += 1
        row[1] += 0 if is_test else text.count("\n")
        row[2] += text.count("\n") if is_test else 0
        name = path.relative_to(root).as_posix()
        texts.append((name, text))
        if not is_test:
            long_ones += [(lines, f"{name}:{first} {function}") for function, first, lines in functions(text) if lines > arguments.long]
    print("package                      files   lines   lines of tests")
    for package, (files, lines, tests) in sorted(count.items()):
        print(f"{package:28} {files:5} {lines:7} {tests:8}")
    print(f"{'all':28} {sum(r[0] for r in count.values()):5} {sum(r[1] for r in count.values()):7} "
          f"{sum(r[2] for r in count.values()):8}")
    print(f"functions of more than {arguments.long} lines: {len(long_ones)}")
    for lines, where in sorted(long_ones, reverse=True):
        print(f"  {lines:4} {where}")
    pairs = repeated(texts, arguments.run)
    print(f"pairs of files that share a run of {arguments.run} lines: {len(pairs)}")
    for (path, other), (first, second) in sorted(pairs.items()):
        print(f"  {path}:{first} = {other}:{second}")


main()
