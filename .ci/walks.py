"""Tables of documents that lead through the code, checked against the code.

A table with a column "file" and a column "defines" states: each name of "defines" is defined in a file of the row, and each name of the
column "uses" occurs in the body of one of these definitions. In a section "Walk" each row continues an earlier one: it shares a name
(of a function, class, key or file) with that row. Names and paths are in backticks.
"""
import re

CODE = re.compile(r"`([^`]+)`")
COMMENT_OR_STRING = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])\'', re.DOTALL)


def spaces(match):
    return re.sub(r"[^\n]", " ", match.group(0))


def without_comments(text):
    return COMMENT_OR_STRING.sub(lambda m: spaces(m) if m.group(0).startswith("/") else m.group(0), text)


def closing(text, at):
    """Position after the bracket that closes the one at a position."""
    pairs = {"(": ")", "{": "}"}
    opened, depth = text[at], 0
    for i in range(at, len(text)):
        depth += (text[i] == opened) - (text[i] == pairs[opened])
        if depth == 0:
            return i + 1
    return len(text)


def body_at(text, at):
    """Range of the body of a function whose parameters begin at a position; empty: a declaration or a call."""
    i = closing(text, at)
    head = re.compile(r"\s*((const|override|final|noexcept)\s*)*(->[^{;]*)?").match(text, i)
    i = head.end()
    if i < len(text) and text[i] == ":" and text[i:i + 2] != "::":  # initialisers of members
        while i < len(text) and text[i] != ";":
            if text[i] == "(" or (text[i] == "{" and re.search(r"[\w>]\s?$", text[:i])):
                i = closing(text, i)
            elif text[i] == "{":
                break
            else:
                i += 1
    return (i, closing(text, i)) if i < len(text) and text[i] == "{" else None


def definition(name, text):
    """Text of the definitions of a function, class, test or constant of C++, all overloads; empty: none."""
    code = COMMENT_OR_STRING.sub(spaces, text)
    readable = without_comments(text)
    last = re.escape(name.split("::")[-1])

    def bodies(pattern, begin, end):
        found = []
        for match in re.finditer(rf"(?<![\w.:>~]){pattern}\s*(\()", code[:end]):
            if match.start() >= begin and (body := body_at(code, match.start(1))):
                found.append(readable[match.start():body[1]])
        return "\n".join(found)

    if "::" not in name:
        if match := re.search(rf"\b(?:class|struct|enum(?:\s+class)?)\s+{last}\b[^;{{()]*(\{{)", code):
            return readable[match.start():closing(code, match.start(1))]
        if match := re.search(rf"\bTEST(?:_F|_P)?(\()\w+,\s*{last}\)", code):
            return readable[match.start():closing(code, body_at(code, match.start(1))[0])]
    if found := bodies(re.escape(name), 0, len(code)):
        return found
    if "::" not in name:
        # A declaration, a constant or an initialised member.
        match = re.search(rf"^[ \w:<>,&*]*[\w>&*][ &*]+{last}\s*[(={{;][^\n]*|^\s*{last}\s*=[^=][^\n]*", code, re.MULTILINE)
        return readable[match.start():match.end()] if match else ""
    # A member inside its class, or declared in a header.
    owner = re.search(rf"\b(?:class|struct|namespace)\s+{re.escape(name.split('::')[-2])}\b[^;{{()]*(\{{)", code)
    if not owner:
        return ""
    begin, end = owner.start(1), closing(code, owner.start(1))
    if found := bodies(last, begin, end):
        return found
    match = re.search(rf"(?<![\w.:>~]){last}\s*[(<={{;][^\n]*", code[begin:end])
    return readable[begin + match.start():begin + match.end()] if match else ""


def contains(name, text):
    """Whether a text has a name as a word; of Class::member the member."""
    word = name if "/" in name or '"' in name else name.split("::")[-1]
    return re.search(rf"(?<![\w]){re.escape(word)}(?![\w])", text) is not None


def row_faults(files, defines, uses):
    bodies = {}
    for name in defines:
        for path, text in files.items():
            cpp = path.endswith((".cpp", ".h"))
            found = definition(name, text) if cpp else text if contains(name, text) else ""
            # The longest: a body in place of a declaration.
            if len(found) > len(bodies.get(name, "")):
                bodies[name] = found
        if name not in bodies:
            yield f"{name} is not defined in {', '.join(files)}"
    if bodies:
        for name in uses:
            if not any(contains(name, body) for body in bodies.values()):
                yield f"{name} is not used by {', '.join(bodies)}"


def tables(text):
    """(heading, rows) of each table that leads through the code; a row is {column: cell}."""
    heading, columns, rows = "", None, []
    for line in [*text.split("\n"), ""]:
        if line.startswith("#"):
            heading = line.lstrip("# ")
        if not line.startswith("|"):
            if rows:
                yield heading, rows
            columns, rows = None, []
            continue
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if columns is None:
            columns = cells
        elif "file" in columns and "defines" in columns and not re.fullmatch(r"[-: ]+", cells[0] or "-"):
            rows.append(dict(zip(columns, cells)))


def faults(text, find):
    """Claims that the code contradicts, and their number. @param find path of a file named in a document; empty: none"""
    wrong, claims = [], 0
    for heading, rows in tables(text):
        earlier = set()
        for number, row in enumerate(rows, 1):
            where = f"'{heading}', row {number}"
            paths = {name: find(name) for name in CODE.findall(row["file"])}
            defines, uses = CODE.findall(row["defines"]), CODE.findall(row.get("uses", ""))
            wrong += [f"{where}: {name}: there is no such file" for name, path in paths.items() if not path]
            files = {name: path.read_text(encoding="utf-8") for name, path in paths.items() if path}
            wrong += [f"{where}: {fault}" for fault in row_faults(files, defines, uses)]
            if not files or not defines:
                wrong.append(f"{where}: expected a file and what it defines, in backticks")
            names = {part for name in defines + uses for part in name.split("::")}
            names |= {path.stem for path in paths.values() if path}
            if heading.startswith("Walk") and number > 1 and not names & earlier:
                wrong.append(f"{where}: shares no name with an earlier row, expected a continuous walk")
            earlier |= names
            claims += len(paths) + len(defines) + len(uses)
    return wrong, claims
