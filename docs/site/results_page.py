#!/usr/bin/env python3
"""Makes docs/results.md and docs/ledger.md from the records of studies in smartmill_studies/records.

usage: results_page.py [--check] [--records FOLDER] [--page FILE] [--ledger FILE]
  --check  writes nothing; fails where a record is invalid or a page is out of date

One file NAME.json is one run of one study. Of several records of a study the newest is shown. Numbers are printed with the digits of the file.
Keys of a record (null: not recorded):
  study       identifier: lower case, digits and underscores; the anchor on the page
  package     heading on the page
  title       what the study shows
  command     one command, or Markdown with several
  commit      commit of the program
  date        YYYY-MM-DD
  machine     computer and its load
  seed        number or text
  parameters  everything else that determines the result
  figures     list of {name, value, unit, target, met}; met is true, false, or null where nothing is required
  tables      optional list of {title, columns, rows}
  remark      text, or null
  ledger      optional {what: number}: what the run adds to the ledger of the running graph (hours, kills, messages)
"""
import argparse
import decimal
import json
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
TEXT, NUMBER = (str,), (int, decimal.Decimal)
NOTHING = (type(None),)
KEYS = {"study": TEXT, "package": TEXT, "title": TEXT, "command": TEXT + NOTHING, "commit": TEXT + NOTHING, "date": TEXT + NOTHING,
        "machine": TEXT + NOTHING, "seed": TEXT + NUMBER + NOTHING, "parameters": TEXT + NOTHING, "figures": (list,), "tables": (list,),
        "remark": TEXT + NOTHING, "ledger": (dict,)}
OPTIONAL = {"tables", "ledger"}
FIGURE = {"name": TEXT, "value": TEXT + NUMBER, "unit": TEXT + NOTHING, "target": TEXT + NUMBER + NOTHING, "met": (bool, *NOTHING)}
TABLE = {"title": TEXT, "columns": (list,), "rows": (list,)}
KINDS = {str: "text", int: "a number", decimal.Decimal: "a number", bool: "true or false", list: "a list", type(None): "null"}
INTRODUCTION = """\
# Results

Made by `docs/site/results_page.py` from the records in `smartmill_studies/records`; a change of this page is lost. The newest record of each
study is shown with its command, figures, targets and verdicts. Every command exists after `./setup`. SHARED is the folder with measured
records and independent campaigns; "shipped" means the parameters of `launch/config`. {count} studies; {missed} of {judged} figures with a verdict
miss their target; where no verdict was recorded, none is shown.

Stability charts of a session come from fitted modes; they are checked by the full search of collocation on the true machine and by cuts in the
simulator, which is independent of the solvers. Compensated forces, tool modes and coefficients of a session are checked against the simulated machine, whose physics is validated
by the campaigns of an independent program.
"""

LEDGER = """\
# Ledger of the running graph

Made by `docs/site/results_page.py` from the records in `smartmill_studies/records` that count hours, faults or losses; a change of this page is lost. Each run can be
repeated by its command and seed. [reliability.md](reliability.md) describes what is tested.
"""


class Invalid(Exception):
    """What is wrong with a record: key, and what was expected."""


def check_keys(value, keys, where, optional=frozenset()):
    if not isinstance(value, dict):
        raise Invalid(f"{where or 'record'}: expected an object")
    dot = where + "." if where else ""
    for key in value:
        if key not in keys:
            raise Invalid(f"{dot}{key}: unknown key, expected one of {', '.join(keys)}")
    for key, kinds in keys.items():
        if key not in value:
            if key not in optional:
                raise Invalid(f"{dot}{key}: not found")
        elif type(value[key]) not in kinds:
            expected = " or ".join(dict.fromkeys(KINDS[kind] for kind in kinds))
            raise Invalid(f"{dot}{key}: {value[key]!r}, expected {expected}")


def check(record):
    check_keys(record, KEYS, "", OPTIONAL)
    if not re.fullmatch(r"[a-z0-9_]+", record["study"]):
        raise Invalid(f"study: '{record['study']}', expected lower case, digits and underscores")
    if record["date"] is not None and not re.fullmatch(r"\d{4}-\d\d-\d\d", record["date"]):
        raise Invalid(f"date: '{record['date']}', expected YYYY-MM-DD or null")
    for i, figure in enumerate(record["figures"]):
        check_keys(figure, FIGURE, f"figures[{i}]")
        if figure["met"] is not None and figure["target"] is None:
            raise Invalid(f"figures[{i}].met: {figure['met']!r}, expected null without a target")
    for i, table in enumerate(record.get("tables", [])):
        check_keys(table, TABLE, f"tables[{i}]")
        for j, row in enumerate(table["rows"]):
            if not isinstance(row, list) or len(row) != len(table["columns"]):
                raise Invalid(f"tables[{i}].rows[{j}]: expected a list of {len(table['columns'])} cells")
    for what, number in record.get("ledger", {}).items():
        if type(number) not in NUMBER:
            raise Invalid(f"ledger.{what}: {number!r}, expected a number")
    if not record["figures"] and not record.get("tables"):
        raise Invalid("figures: expected at least one figure or table")


def read(path):
    """A checked record; numbers keep their digits."""
    try:
        record = json.loads(path.read_text(encoding="utf-8"), parse_float=decimal.Decimal)
        check(record)
    except (ValueError, Invalid) as error:
        raise Invalid(f"{path}: {error}") from None
    return record


def newest(paths):
    """The newest record of each study, by package and file name. One without a date is the oldest."""
    found = {}
    for path in paths:
        record = read(path)
        before = found.get(record["study"])
        if before and before["date"] == record["date"]:
            raise Invalid(f"{path}: date: a second record of study '{record['study']}' on the same date")
        if not before or (record["date"] or "") > (before["date"] or ""):
            found[record["study"]] = record
    return list(found.values())


def verdict(met):
    return {True: "met", False: "**missed**", None: ""}[met]


def cell(text):
    return str(text).replace("|", "\\|").replace("\n", " ")


def figure_text(figure):
    text = f"{figure['name']}: {figure['value']}" if figure["value"] != "" else figure["name"]
    if figure["unit"]:
        text += f" {figure['unit']}"
    if figure["target"] is not None:
        judged = f": {verdict(figure['met'])}" if figure["met"] is not None else ""
        text += f" (target {figure['target']}{judged})"
    return text


def study_row(record):
    command = record["command"]
    if command and "`" not in command:
        command = f"`{command}`"
    parameters = record["parameters"] or ""
    seed = str(record["seed"]) if record["seed"] is not None else None
    if seed and not re.search(rf"seeds?\W+{re.escape(seed)}", f"{parameters} {command}"):
        parameters += f"{'; ' if parameters else ''}seed {seed}"
    about = [f"<a id=\"{record['study']}\"></a>**{record['title']}**", command or "command not recorded", parameters, record["remark"]]
    figures = [figure_text(figure) for figure in record["figures"]] or ["table below"]
    origin = [record["date"] or "date not recorded", f"commit {record['commit'] or 'not recorded'}",
              f"machine {record['machine'] or 'not recorded'}"]
    return "| " + " | ".join(cell("<br>".join(part for part in column if part)) for column in (about, figures, origin)) + " |"


def table_lines(table):
    yield f"**{table['title']}**"
    yield ""
    yield "| " + " | ".join(cell(column) for column in table["columns"]) + " |"
    yield "|" + "---|" * len(table["columns"])
    for row in table["rows"]:
        yield "| " + " | ".join(cell(value) for value in row) + " |"
    yield ""


def page(records):
    judged = [figure["met"] for record in records for figure in record["figures"] if figure["met"] is not None]
    lines = INTRODUCTION.format(count=len(records), missed=judged.count(False), judged=len(judged)).splitlines()
    for package in sorted({record["package"] for record in records}):
        members = [record for record in records if record["package"] == package]
        lines += ["", f"## {package}", "", "| study, command, parameters | figures | run |", "|---|---|---|"]
        lines += [study_row(record) for record in members]
        lines.append("")
        for record in members:
            for table in record.get("tables", []):
                lines += table_lines(table)
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines).strip()) + "\n"


def ledger(records):
    counted = [record for record in records if "ledger" in record]
    totals = {}
    for record in counted:
        for what, number in record["ledger"].items():
            totals[what] = totals.get(what, 0) + number
    lines = LEDGER.splitlines() + ["", "## Totals", "", "| what | total |", "|---|---|"]
    lines += [f"| {what} | {number:,} |" for what, number in totals.items()]
    lines += ["", "## Runs", "", "| run | counted | command, seed | date, commit |", "|---|---|---|---|"]
    for record in counted:
        parts = [f"{what}: {number:,}" for what, number in record["ledger"].items()]
        command = record["command"] or "command not recorded"
        command += f"<br>seed {record['seed']}" if record["seed"] is not None else ""
        lines.append("| " + " | ".join(cell(text) for text in (f"[{record['title']}](results.md#{record['study']})", "<br>".join(parts), command,
                                                               f"{record['date']}, {record['commit']}")) + " |")
    missed = [(record, figure) for record in counted for figure in record["figures"] if figure["met"] is False]
    lines += ["", "## Open failures", "", "| run | figure |", "|---|---|"]
    lines += [f"| [{record['study']}](results.md#{record['study']}) | {cell(figure_text(figure))} |" for record, figure in missed]
    return "\n".join(lines) + "\n"


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing; fail where a record is invalid or the page is out of date")
    parser.add_argument("--records", type=pathlib.Path, default=ROOT / "smartmill_studies/records")
    parser.add_argument("--page", type=pathlib.Path, default=ROOT / "docs/results.md")
    parser.add_argument("--ledger", type=pathlib.Path)
    options = parser.parse_args(arguments)
    try:
        records = newest(sorted(options.records.glob("*.json")))
    except Invalid as error:
        print(error, file=sys.stderr)
        return 1
    pages = {options.page: page(records), options.ledger or options.page.with_name("ledger.md"): ledger(records)}
    out_of_date = [file for file, text in pages.items() if not file.is_file() or file.read_text(encoding="utf-8") != text]
    if not options.check:
        for file, text in pages.items():
            file.write_text(text, encoding="utf-8")
        return 0
    for file in out_of_date:
        print(f"{file}: out of date, expected the output of docs/site/results_page.py", file=sys.stderr)
    return 1 if out_of_date else 0


if __name__ == "__main__":
    sys.exit(main())
