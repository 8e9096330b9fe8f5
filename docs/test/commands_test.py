"""Commands in README.md and in the pages agree with --help of the programs: the program exists, so do the options, and nothing required is missing.

$SMARTMILL is the program; programs that only `rosrun` finds are in ../lib of its folder, and are left out where they are not built.
Tutorials are run by tutorials_test.
"""
import functools
import os
import pathlib
import re
import subprocess
import unittest

DOCS = pathlib.Path(__file__).resolve().parents[1]
SMARTMILL = pathlib.Path(os.environ.get("SMARTMILL", "smartmill"))
TOOLS = {"coefficients_db": "database"}  # name in its package: command
COMMAND = re.compile(r"rosrun (smartmill_\w+) (\w+)(.*)|smartmill ([a-z][\w-]*)(.*)", re.DOTALL)
OPTION = re.compile(r"(?<![\w-])--?[a-z][\w-]*")


@functools.lru_cache(maxsize=None)
def help_of(*command):
    """Output of --help; empty: it fails."""
    run = subprocess.run([*command, "--help"], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60)
    return run.stdout if run.returncode == 0 else ""


@functools.lru_cache(maxsize=None)
def commands():
    """Names of the commands of smartmill."""
    return set(re.findall(r"^  ([a-z][a-z-]*)  ", help_of(SMARTMILL), re.MULTILINE)) | {"manual", "completion"}


def program(package, name):
    """The command line of a program of a package; empty: a node, or not built."""
    command = TOOLS.get(name, name.replace("_", "-"))
    if command in commands():
        return (SMARTMILL, command)
    path = SMARTMILL.parent.parent / "lib" / package / name
    return (path,) if path.exists() and "_node" not in name and name != "monitor" else ()


def required(text):
    """Required positionals and options of a help text."""
    names = re.findall(r"^  (-\S+|[A-Za-z]\w*)[^\n]*REQUIRED", text, re.MULTILINE)
    return [n for n in names if not n.startswith("-")], [n.split(",") for n in names if n.startswith("-")]


def snippets(text):
    """(line, command) of indented blocks (whole) and of code in a line (not whole)."""
    text = re.sub(r"\\\n", "  ", text)
    for match in re.finditer(r"^ {4}(\S[^\n]*)$", text, re.MULTILINE):
        yield text.count("\n", 0, match.start()) + 1, re.split(r"\s+# ", match[1])[0], True
    for match in re.finditer(r"`([^`]+)`", text):
        yield text.count("\n", 0, match.start()) + 1, match[1], False


def faults(snippet, whole):
    match = COMMAND.fullmatch(snippet.strip())
    if not match:
        return
    package, tool, arguments = (match[1], match[2], match[3]) if match[1] else ("", match[4], match[5])
    if not package and tool not in commands():
        yield f"smartmill has no command {tool}"
        return
    command = program(package, tool) if package else (SMARTMILL, tool)
    if not command:
        return
    text = help_of(*command)
    subcommands = re.findall(r"^  (\w[\w-]*)  ", text.partition("Subcommands:")[2].partition("\n\n")[0], re.MULTILINE)
    chosen = next((word for word in arguments.split() if word in subcommands), "")
    if chosen:
        text += help_of(*command, *(["unused"] if "Positionals:" in text else []), chosen)
    if not text:
        yield f"{' '.join(map(str, command))} --help fails"
    for option in OPTION.findall(arguments):
        if not re.search(rf"(?<![\w-]){re.escape(option)}(?![\w-])", text):
            yield f"there is no option {option}"
    if not whole:
        return
    positionals, options = required(text)
    for names in options:
        if not any(re.search(rf"(?<!\S){re.escape(name)}(?!\S)", arguments) for name in names):
            yield f"{names[-1]} is required"
    words = re.sub(r"\[[^\]]*\]|--?[a-z][\w-]* \S+", "", arguments).split()
    if len(words) < len(positionals):
        yield f"expected {' '.join(positionals)}"


class Commands(unittest.TestCase):
    def test_commands_of_documents_agree_with_help(self):
        checked = 0
        for page in [DOCS.parent / "README.md", *sorted(DOCS.glob("*.md"))]:
            for line, snippet, whole in snippets(page.read_text(encoding="utf-8")):
                checked += COMMAND.fullmatch(snippet.strip()) is not None
                for fault in faults(" ".join(snippet.split()), whole):
                    with self.subTest(page=page.name, line=line):
                        self.fail(f"{fault}: {snippet}")
        self.assertGreater(checked, 100)

    def test_faults_are_found(self):
        self.assertEqual(list(faults("smartmill simulate MODEL -o OUT", True)), ["expected MODEL CAMPAIGN"])
        self.assertEqual(list(faults("smartmill simulate MODEL CAMPAIGN", True)), ["--out is required"])
        self.assertEqual(list(faults("smartmill gap CAMPAIGN --models M", False)), ["there is no option --models"])
        self.assertEqual(list(faults("smartmill simulates", False)), ["smartmill has no command simulates"])


if __name__ == "__main__":
    unittest.main()
