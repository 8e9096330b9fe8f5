"""Reference pages of the site, made from message files, launch files, parameter files, node sources and the tables of `smartmill`."""
import pathlib
import re
import subprocess
import tempfile
import xml.etree.ElementTree as ElementTree


def cell(text):
    """Text for a cell of a table."""
    return re.sub(r"\s+", " ", text).strip().replace("|", "\\|").replace("<", "&lt;")


def code(text):
    return "`" + text.replace("|", "\\|") + "`" if text else ""


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


# Programs

def unroff(text):
    return re.sub(r"\\f[BIR]", "", text).replace("\\(aq", "'").replace("\\-", "-").replace("\\&", "").replace("\\e", "\\")


def sections(manual):
    """(title, lines) of a manual page."""
    found = []
    for line in manual.splitlines():
        if line.startswith(".SH "):
            found.append((line[4:].strip('"'), []))
        elif found and not re.match(r"\.(TH|nh|hy|ad|na|ft)\b", line):
            found[-1][1].append(line)
    return found


def entries(lines):
    """(term, text) of the tagged paragraphs of a section."""
    found = []
    for line in lines:
        if line.startswith(".TP"):
            found.append([None, ""])
        elif found and found[-1][0] is None:
            found[-1][0] = unroff(line)
        elif found and not line.startswith("."):
            found[-1][1] += " " + unroff(line)
    return found


def manual_page(name, text):
    out = [f"## {name}\n"]
    heads = {"OPTIONS": ("option", "meaning"), "FILES": ("file", "content")}
    for title, lines in sections(text):
        if title in heads and entries(lines):
            # A parameter file's keys are in the reference of parameters.
            rows = [(code(term), cell(meaning)) for term, meaning in entries(lines)]
            out.append(table(heads[title], rows))
        elif title == "SYNOPSIS":
            out.append("```text\n" + " ".join(unroff(line) for line in lines if not line.startswith(".")).strip() + "\n```\n")
        elif title == "DESCRIPTION":
            plain = [unroff(line) for line in lines if not line.startswith(".")]
            out.append(" ".join(plain).replace("<", "&lt;") + "\n")
        elif title == "EXAMPLES":
            examples = [f"$ {term}\n    {meaning.strip()}" for term, meaning in entries(lines)]
            if examples:
                out.append("```text\n" + "\n".join(examples) + "\n```\n")
    return "\n".join(out)


def programs(smartmill):
    """One section a command, from the manual pages that the program writes of its own tables."""
    overview = subprocess.run([smartmill, "--help"], check=True, capture_output=True, text=True).stdout
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([smartmill, "manual", "-o", folder], check=True, capture_output=True)
        pages = {path.stem: path.read_text(encoding="utf-8") for path in pathlib.Path(folder).glob("*.1")}
    order = re.findall(r"^  ([a-z][\w-]*)  +\S", overview, re.MULTILINE)
    parts = [manual_page(f"smartmill {name}", pages[f"smartmill-{name}"]) for name in order]
    return ("# Programs\n\nThe commands of `smartmill`, from the tables behind `--help` and the manual pages. "
            "[The program `smartmill`](../program.md) describes input, output and exit codes.\n\n"
            f"```text\n{overview}```\n\n" + "\n".join(parts))


# Messages

KINDS = {"msg": ("Messages", []), "srv": ("Services", ["Request", "Response"]), "action": ("Actions", ["Goal", "Result", "Feedback"])}


def heading(lines):
    """The comment lines in front of the fields, and the other lines."""
    count = 0
    while count < len(lines) and lines[count].startswith("#"):
        count += 1
    return " ".join(line.lstrip("# ") for line in lines[:count]), lines[count:]


def fields(lines):
    rows = []
    for line in lines:
        definition, _, comment = line.partition("#")
        words = definition.split()
        if len(words) >= 2:
            rows.append([code(" ".join(words[1:])), code(words[0]), comment.strip()])
        elif rows and comment.strip():  # the comment goes on
            rows[-1][2] += " " + comment.strip()
    return table(("field", "type", "meaning"), [(name, kind, cell(comment)) for name, kind, comment in rows]) if rows else "Empty.\n"


def messages(root):
    out = ["# Messages\n\nDefinitions of `smartmill_msgs`. A field's comment states its unit in brackets; `[-]` has no unit.\n"]
    for kind, (title, names) in KINDS.items():
        out.append(f"## {title}\n")
        for path in sorted((root / "smartmill_msgs" / kind).glob(f"*.{kind}")):
            meaning, lines = heading(path.read_text(encoding="utf-8").splitlines())
            out.append(f"### {path.stem}\n\n{cell(meaning)}\n")
            if names:
                for name, text in zip(names, re.split(r"^---$", "\n".join(lines), flags=re.MULTILINE)):
                    out.append(f"**{name}**\n\n{fields(text.splitlines())}")
            else:
                out.append(fields(lines))
    return "\n".join(out)


# Topics

NAME = r'(?:smartmill::)?names::(?:absolute\(names::)?(\w+(?:\("\w+"\))?)'


class Graph:
    """Topics, services and actions, as the node sources declare them."""

    def __init__(self, root):
        self.topics, self.services, self.actions = {}, {}, {}  # name: (type, {package}, {package that reads})
        self.constants, self.kind = {}, {}
        kind = "topic"
        for line in (root / "src/smartmill_core/include/smartmill_core/names.h").read_text(encoding="utf-8").splitlines():
            kind = {"// Actions.": "action", "// Services.": "service"}.get(line.strip(), kind)
            match = re.match(r'constexpr const char\* (\w+) = "([\w/]+)";', line)
            if match and match[1] != "NAMESPACE":
                self.constants[match[1]] = match[2]
                self.kind[match[2]] = kind
        sources = [path for path in root.glob("*/src/**/*") if path.suffix in (".cpp", ".h") and {"node", "session"} & set(path.parts)]
        sources += (root / "src/smartmill_ros/src").glob("*.cpp")
        texts = {path: path.read_text(encoding="utf-8") for path in sources}
        for path, text in texts.items():
            self.read(self.users(root, path, texts), text, "".join(
                t for p, t in texts.items() if p.parent == path.parent))

    @staticmethod
    def users(root, path, texts):
        """Packages whose node a source belongs to; for the common part of the nodes those that include it."""
        package = path.relative_to(root).parts[0]
        if package != "src":
            return {"smartmill_launch" if package == "launch" else package}
        header = f'"smartmill_ros/{path.stem}.h"'
        return {p.relative_to(root).parts[0] for p, t in texts.items() if header in t and p.relative_to(root).parts[0] != "src"}

    def name(self, word, text):
        daq = re.fullmatch(r'daq\("(\w+)"\)', word)
        if daq:
            return "daq/" + daq[1]
        local = re.search(rf'constexpr const char\* {word} = "([^"]+)"', text)
        return self.constants.get(word) or (local[1] if local else None)

    def add(self, entries, name, kind, publishers=(), readers=()):
        if name:
            entry = entries.setdefault(name, ["", set(), set()])
            entry[0] = entry[0] or kind
            entry[1].update(publishers)
            entry[2].update(readers)

    def read(self, users, text, folder):
        messages = r"(?:smartmill_msgs|std_msgs|geometry_msgs)::(\w+)"
        for kind, word in re.findall(rf"advertise<{messages}>\(\s*{NAME}", text):
            self.add(self.topics, self.name(word, folder), kind, publishers=users)
        for kind, word in re.findall(rf"advertise<{messages}>\(([A-Z_]+),", text):
            self.add(self.topics, self.name(word, folder), kind, publishers=users)
        for alias, word in re.findall(rf"advertise<(\w+)>\(\s*{NAME}", text):
            kind = re.search(rf"using {alias} = {messages};", folder)
            self.add(self.topics, self.name(word, folder), kind[1] if kind else "", publishers=users)
        for kind, member in re.findall(rf"LatchedTopic<{messages}> (\w+)", folder):
            for word in re.findall(rf"\b{member}\(nh_?, {NAME}\)", text):
                self.add(self.topics, self.name(word, folder), kind, publishers=users)
        # The topic may be chosen by a parameter: every name in front of the callback counts.
        for call in re.findall(r"\b(?:(?:feed|on)<[\w:]+>|subscribe(?:<[^;(]*>)?)\(([^;{\[]*)", text):
            for word in re.findall(NAME, call):
                if self.kind.get(self.name(word, folder), "topic") == "topic":
                    self.add(self.topics, self.name(word, folder), "", readers=users)
        for word, handler in re.findall(rf"advertiseService\(\s*{NAME}\)?,\s*&\w+::(\w+)", text):
            kind = re.search(rf"bool {handler}\(smartmill_msgs::(\w+)::Request", folder)
            event = re.search(rf"bool {handler}\((\w+)& ", folder)  # with the name of the caller
            if event and not kind:
                kind = re.search(rf"using {event[1]} =\s*ros::ServiceEvent<smartmill_msgs::(\w+)::Request", folder)
            self.add(self.services, self.name(word, folder), kind[1] if kind else "", publishers=users)
        for word, request in re.findall(rf"advertiseService\(\s*{NAME},\s*boost::function<bool\((\w+)(?:::Request)?&", text):
            alias = re.search(rf"using {request} = smartmill_msgs::(\w+)::Request;", text)
            self.add(self.services, self.name(word, folder), alias[1] if alias else request, publishers=users)
        for word in re.findall(rf"serviceClient<[^>]*>\({NAME}", text):
            self.add(self.services, self.name(word, folder), "", readers=users)
        for kind, word in re.findall(rf"serve<smartmill_msgs::(\w+)Action>\(\s*nh, {NAME}", text):
            self.add(self.actions, self.name(word, folder), kind, publishers=users)
        for word in re.findall(rf"[sS]erver\w*>?\(\s*nh_?, {NAME}", text):
            name = self.name(word, folder)
            if self.kind.get(name) == "action":
                kind = "MeasureFrf" if name.endswith("measure_frf") else re.search(r"ActionServer<smartmill_msgs::(\w+)Action>", folder)[1]
                self.add(self.actions, name, kind, publishers=users)


def topics(root):
    graph = Graph(root)
    known = {path.stem for path in (root / "smartmill_msgs").glob("*/*.*")}

    def linked(kind):
        return f"[{kind}](messages.md#{kind.lower()})" if kind in known else kind

    def packages(names):
        return ", ".join(code(name) for name in sorted(names))

    def rows(entries):
        return [(code(name), linked(kind), packages(publishers), packages(readers))
                for name, (kind, publishers, readers) in sorted(entries.items()) if publishers]

    missing = [name for name, kind in graph.kind.items() if kind != "topic" and name not in {**graph.actions, **graph.services}]
    untyped = [name for entries in (graph.topics, graph.services, graph.actions) for name, entry in entries.items()
               if entry[1] and not entry[0]]
    if missing or untyped:
        raise SystemExit(f"reference_pages: no type or no server found in the node sources: {' '.join(missing + untyped)}")
    return "\n".join([
        "# Topics, services and actions\n\nNames are relative to the namespace `/smartmill` and defined in `smartmill_core/names.h`. Signals of a data "
        "acquisition have the names `daq/SIGNAL`. On a machine they come from its driver, in simulation from `smartmill_sim`. Readers whose topic is a parameter "
        "(for example `force_input` of `smartmill_kalman`) and the panel, which passes on all topics, are not listed.\n",
        "## Topics\n", table(("topic", "message", "published by", "read by"), rows(graph.topics)),
        "## Services\n", table(("service", "type", "offered by", "called by"), rows(graph.services)),
        "## Actions\n", table(("action", "type", "served by"), [row[:3] for row in rows(graph.actions)])])


# Launch files and parameters

def launch_files(root):
    out = ["# Launch files\n\nStarted with `roslaunch smartmill_launch FILE ARGUMENT:=VALUE ...`; `$(find smartmill_launch)` is the folder of the package.\n"]
    for path in sorted((root / "launch/launch").glob("*.launch")):
        text = path.read_text(encoding="utf-8")
        comment = re.match(r"\s*(?:<\?xml.*?\?>\s*)?<!--(.*?)-->", text, re.DOTALL)
        out.append(f"## {path.name}\n")
        if comment:
            prose, commands = [], []
            for line in comment[1].strip().splitlines():
                (commands if line.strip().startswith(("roslaunch", "rosrun")) else prose).append(line.strip())
            out.append(cell(" ".join(prose)) + "\n")
            if commands:
                out.append("```text\n" + "\n".join(commands) + "\n```\n")
        tree = ElementTree.fromstring(text)
        arguments = [(code(a.get("name")), code(a.get("default")) if a.get("default") else "empty" if a.get("default") == "" else "required",
                      cell(a.get("doc") or "")) for a in tree.findall("arg") if a.get("value") is None]
        if arguments:
            out.append(table(("argument", "default", "meaning"), arguments))
        nodes = sorted({(n.get("pkg"), n.get("type")) for n in tree.iter("node")})
        if nodes:
            out.append("Starts " + ", ".join(f"`{package}/{kind}`" for package, kind in nodes) + ".\n")
    return "\n".join(out)


PARAMETER = re.compile(r"^(\w+):\s*(\"[^\"]*\"|\[[^\]]*\]|[^#]*?)\s*(?:#\s*(.*))?$")


def parameter_file(path):
    """A section of a parameter file: what it is of, then a table for each group."""
    intro, groups, in_head = [], [["", []]], True
    for line in path.read_text(encoding="utf-8").splitlines():
        match = PARAMETER.match(line)
        if match:
            in_head = False
            groups[-1][1].append([match[1], match[2], match[3] or ""])
        elif re.match(r"\s+#", line) and groups[-1][1]:  # the comment goes on
            groups[-1][1][-1][2] += " " + line.strip().lstrip("# ")
        elif line.startswith("#") and in_head and not groups[-1][0] and groups == [["", []]] and intro[-1:] != [None]:
            intro.append(line.lstrip("# "))
        elif line.startswith("#"):
            if groups[-1][1] or not groups[-1][0]:
                groups.append([line.lstrip("# "), []])
            else:
                groups[-1][0] += " " + line.lstrip("# ")
        elif not line.strip() and in_head:
            intro.append(None)
        elif not line.strip() and groups[-1][1]:
            groups.append(["", []])
    out = [f"## {path.name}\n", cell(intro[0]) + "\n" if intro else ""]
    rules = [line for line in intro[1:] if line and re.match(r"\w+: ", line)]
    out += ["- `{}`: {}".format(*map(cell, line.split(":", 1))) for line in rules]
    if rules:
        out.append("")
    for title, rows in groups:
        if title:
            out.append(f"**{cell(title)}**\n")
        if rows:
            out.append(table(("parameter", "shipped value", "meaning"), [(code(k), code(v), cell(m)) for k, v, m in rows]))
    return "\n".join(out)


def parameters(root):
    files = sorted((root / "launch/config").glob("*.yaml")) + sorted(root.glob("smartmill_*/config/*.yaml"))
    return ("# Parameters\n\nThe shipped parameter files, one a node. Unknown keys, wrong types and values out of range are refused in one line. A number that may "
            "have a fraction needs a point, its exponent a sign: `1.0e-2`, never `1e-2`.\n\n" + "\n".join(parameter_file(path) for path in files))


def api(root):
    headers = sorted(path for folder in ("src", ".") for path in root.glob(f"{folder}/*/include/*/")
                     if path.is_dir() and "build" not in path.relative_to(root).parts[0])
    rows = []
    for folder in headers:
        manifest = folder.parent.parent / "package.xml"
        description = ElementTree.parse(manifest).getroot().findtext("description") if manifest.exists() else ""
        rows.append((code(folder.name), str(len(list(folder.rglob("*.h")))), cell(description or "")))
    return ("# C++ interface\n\nThe public headers of the libraries, by doxygen, with a search of its own: "
            "<a href=\"../api/annotated.html\">classes</a>, <a href=\"../api/namespaces.html\">namespaces</a>, <a href=\"../api/files.html\">files</a>. "
            "Docstrings state units, shapes, errors and sources. [Architecture](../architecture.md) lists where each concept is implemented.\n\n"
            + table(("package", "headers", "contents"), rows)
            + "\nThe Python interface is described in [Python module](../python.md).\n")
