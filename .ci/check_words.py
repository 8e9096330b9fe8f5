#!/usr/bin/env python3
"""Words that documents, comments, logs, errors and help texts do not use: idioms for which the field has a plain term (docs/glossary.md).

usage: check_words.py [--count] [FOLDER...]
  --count   prints the number of occurrences of each word, and does not fail
"""
import collections
import io
import re
import subprocess
import sys
import tokenize

from packages import ROOT

# Pattern: what to write. A lookahead leaves out the plain sense of a word.
BANNED = {
    r"tells?|telling|told": "states, reports, gives, distinguishes",
    r"beside": "next to, in addition to, compared with",
    r"due(?! to\b)": "expected, required, predicted",
    r"(?:stands?|standing|stood)(?! still\b)(?!-)": "is, is defined in, represents",
    r"what is left(?! of\b)|what (?:\w+ )?leaves": "the residual, the remainder",
    r"at hand": "available",
    r"comes? again|came again": "repeats, is synchronous with",
    r"nobody|somebody|whoever": "no node, a client, the caller",
    r"rooms?": "package, folder, space",
    r"asks?|asked|asking": "requires, requests, queries",
    r"bears?": "tolerates, carries",
    r"mend(?:s|ed|ing)?": "corrects, repairs",
    r"honest(?:ly)?": "calibrated, correct",
    r"promis(?:e|es|ed)": "predicts, predicted gain",
    r"speaks? (?:of|for)|spoke (?:of|for)": "describes, indicates",
    r"holds? to|held to": "is checked against, is limited to",
    r"knows?(?! how\b)": "depends on, has, contains",
    r"goes by": "uses",
    r"is let|let be": "is left, is allowed",
    r"twofold|threefold": "twice, three times",
    r"the like": "similar ones",
    r"ere|thereof|therein|thereby|wherein|whereby": "plain words",
}
# Occurrences in their plain sense: part of a line.
ALLOWED = (
    "who knows C++", "let me know", "ask the operator", "asks the operator", "asked the operator", "--ask", "AskPass",
    "tests, asked, report",  # columns of a database
)
EXTENSIONS = (".md", ".cpp", ".h", ".py", ".yaml", ".yml", ".launch", ".msg", ".srv", ".action", ".js", ".html", ".css", ".cmake",
              ".txt", ".toml", "")
WORDS = {re.compile(rf"(?<![\w-])(?:{pattern})(?![\w])", re.IGNORECASE): instead for pattern, instead in BANNED.items()}

C_TEXT = re.compile(r'//([^\n]*)|/\*(.*?)\*/|R"(\w*)\((.*?)\)\3"|"((?:\\.|[^"\\\n])*)"', re.DOTALL)
# Words that code needs, inside a document.
MARKDOWN_CODE = re.compile(r"```.*?```|`[^`\n]*`|^ {4}\S[^\n]*$|\]\([^)]*\)", re.DOTALL | re.MULTILINE)


def blank(match):
    """As many lines, without text."""
    return re.sub(r"[^\n]", " ", match.group(0))


def pieces(path, text):
    """(line number, text) of what a person reads in a file."""
    if path.suffix == ".md":
        for number, line in enumerate(MARKDOWN_CODE.sub(blank, text).split("\n"), 1):
            yield number, line
    elif path.suffix in (".cpp", ".h", ".js", ".css"):
        line, at = 1, 0
        for match in C_TEXT.finditer(text):
            line += text.count("\n", at, match.start())
            at = match.start()
            words = next((g for g in (match[1], match[2], match[4], match[5]) if g), "")
            # A literal without a blank is a key or a name.
            if match[5] is not None and " " not in words:
                continue
            for offset, part in enumerate(words.split("\n")):
                yield line + offset, part
    elif path.suffix == ".py":
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type in (tokenize.COMMENT, tokenize.STRING) and " " in token.string:
                for offset, part in enumerate(token.string.split("\n")):
                    yield token.start[0] + offset, part
    elif path.suffix in (".yaml", ".yml", ".msg", ".srv", ".action", ".cmake", ".txt", ".toml", ""):
        for number, line in enumerate(text.split("\n"), 1):
            if "#" in line:
                yield number, line.split("#", 1)[1]
    else:
        for number, line in enumerate(text.split("\n"), 1):
            yield number, line


def files(folders):
    names = subprocess.run(["git", "-C", ROOT, "ls-files", "--", *folders], check=True, capture_output=True, text=True).stdout
    for name in names.splitlines():
        path = ROOT / name
        if path.suffix in EXTENSIONS and path.name not in ("LICENSE", "check_words.py", "glossary.md"):
            yield name, path


def main():
    arguments = sys.argv[1:]
    counting = "--count" in arguments
    folders = [a for a in arguments if not a.startswith("--")] or ["."]
    counts, faults = collections.Counter(), 0
    for name, path in files(folders):
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue
        if not path.suffix and not text.startswith("#!"):
            continue
        for number, piece in pieces(path, text):
            if any(phrase in piece for phrase in ALLOWED):
                continue
            for word, instead in WORDS.items():
                for match in word.finditer(piece):
                    counts[match.group(0).lower()] += 1
                    if not counting:
                        faults += 1
                        print(f"{name}:{number}: '{match.group(0)}': expected a plain term ({instead})")
    if counting:
        for word, count in counts.most_common():
            print(f"{count:6d} {word}")
    print(f"words: {sum(counts.values())} found, {faults} faults")
    return 1 if faults else 0


sys.exit(main())
