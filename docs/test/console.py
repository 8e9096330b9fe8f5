"""The console blocks of a tutorial: what a reader types, and what the program prints.

A block ```console has lines `$ COMMAND`, each followed by the standard output of the command; a line `...` represents lines left out, `...` between the words of a line any words.
A block ```yaml title="FILE" is a file that the reader writes. Blocks of other kinds are not run.
"""
import pathlib
import re

BLOCK = re.compile(r"^```(\w+)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?(?![\w])", re.IGNORECASE)
TOLERANCE = 0.02  # relative, of a printed number: the last digits depend on compiler and libraries


class Command:
    def __init__(self, text, line):
        self.text, self.line, self.output = text, line, []


class File:
    def __init__(self, name, text):
        self.name, self.text = name, text


def steps(tutorial):
    """Files and commands of a tutorial, in order."""
    text = pathlib.Path(tutorial).read_text(encoding="utf-8")
    found = []
    for match in BLOCK.finditer(text):
        kind, attributes, body = match.groups()
        title = re.search(r'title="([^"]+)"', attributes)
        if title:
            found.append(File(title[1], body))
        elif kind == "console":
            first = text.count("\n", 0, match.start()) + 2
            for number, line in enumerate(body.splitlines(), first):
                if line.startswith("$ "):
                    found.append(Command(line[2:], number))
                elif found and isinstance(found[-1], Command) and found[-1].text.endswith("\\"):
                    found[-1].text = found[-1].text[:-1] + line.strip()
                else:
                    found[-1].output.append(line)
    return found


def agrees(expected, printed):
    """Whether a printed line has the words of the expected one, and its numbers within the tolerance."""
    start, gap, rest = expected.partition(" ... ")
    if gap:
        words, count = printed.split(), len(start.split())
        return agrees(start, " ".join(words[:count])) and any(agrees(rest, " ".join(words[k:])) for k in range(count, len(words) + 1))
    if NUMBER.sub("#", " ".join(expected.split())) != NUMBER.sub("#", " ".join(printed.split())):
        return False
    for a, b in zip(NUMBER.findall(expected), NUMBER.findall(printed)):
        decimals = len(a.partition(".")[2]) if "e" not in a.lower() else 0
        last_digit = 10.0 ** -decimals if decimals else 0.0
        if abs(float(a) - float(b)) > max(TOLERANCE * abs(float(a)), 1.01 * last_digit):
            return False
    return True


def difference(expected, printed):
    """The first line that differs, in words; empty where the output is the expected one."""
    at, gap = 0, False
    for line in expected:
        if line.strip() == "...":
            gap = True
            continue
        found = next((k for k in range(at, len(printed)) if agrees(line, printed[k])), None) if gap else (
            at if at < len(printed) and agrees(line, printed[at]) else None)
        if found is None:
            return f"expected '{line}', printed '{printed[at] if at < len(printed) else 'nothing more'}'"
        at, gap = found + 1, False
    if at < len(printed) and not gap:
        return f"printed '{printed[at]}' after the expected output"
    return ""
