#!/usr/bin/python3
"""Builds the documentation site in build/site, without network: mkdocs for the pages, doxygen for the C++ interface.

usage: build_site.py [--smartmill PROGRAM] [--no-api] [--out FOLDER] [--serve PORT]
  --smartmill  program whose tables become the reference of programs (default: devel/bin/smartmill, that of build_without_ros, or on PATH)
  --no-api     without the C++ interface
  --out        folder of the site (default: build/site); the collected pages are in FOLDER_source
  --serve      serves the built site on 127.0.0.1:PORT until Ctrl-C; the search needs a server

./setup --with-docs installs what it needs.
"""
import argparse
import functools
import http.server
import os
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "docs/site"))
import reference_pages  # noqa: E402

# Pages from outside docs/, by their place in the site.
PAGES = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
WIDE = {"effects.md", "formats.md", "ledger.md", "results.md"}  # tables take the place of the table of contents
HIDE_CONTENTS = "---\nhide: [toc]\n---\n"
COPIED = {".md", ".png", ".svg", ".css"}
LINK = re.compile(r"(\]\()([^)#:\s]+)((?:#[^)]*)?\))")


def fail(line):
    print(f"build_site: {line}", file=sys.stderr)
    sys.exit(1)


def run(command, **options):
    done = subprocess.run([str(word) for word in command], cwd=ROOT, **options)
    if done.returncode:
        fail(f"{command[0]} ended with exit code {done.returncode}")
    return done


def find_program(name, candidates):
    """The first program that exists, or the one on PATH; None where there is none."""
    return next((path for path in candidates if path.is_file()), shutil.which(name))


class Collector:
    """Copies the pages into one folder and makes their links point inside it."""

    def __init__(self, target):
        self.target = target
        self.places = {ROOT / name: target / place for name, place in PAGES.items()}
        for path in sorted((ROOT / "docs").rglob("*")):
            hidden = {"test", "__pycache__"} & set(path.relative_to(ROOT).parts)
            if path.suffix in COPIED and path.name != "build_site.py" and not hidden:
                self.places[path] = target / path.relative_to(ROOT / "docs")

    def copy(self):
        for source, place in list(self.places.items()):
            place.parent.mkdir(parents=True, exist_ok=True)
            if source.suffix == ".md":
                place.write_text(self.page(source, place), encoding="utf-8")
            else:
                shutil.copyfile(source, place)

    def page(self, source, place):
        """Text of a page with the links of its new place. Code is left as it is."""
        parts = re.split(r"(^```.*?^```$|`[^`\n]*`(?!\]))", source.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
        text = "".join(part if part.startswith("`") else LINK.sub(functools.partial(self.link, source, place), part)
                       for part in parts)
        return HIDE_CONTENTS + text if place.name in WIDE else text

    def link(self, source, place, match):
        linked = (source.parent / match[2]).resolve()
        if not linked.exists():
            fail(f"{source.relative_to(ROOT)}: {match[2]}: no such file")
        if linked.is_dir():
            fail(f"{source.relative_to(ROOT)}: {match[2]}: is a folder, expected a file")
        return match[1] + os.path.relpath(self.places.get(linked) or self.source_file(linked), place.parent) + match[3]

    def source_file(self, path):
        """A file that is no page: its text, in the folder `source` of the site."""
        place = self.target / "source" / (str(path.relative_to(ROOT)) + ".txt")
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, place)
        self.places[path] = place
        return place


def write_reference(target, smartmill):
    """Pages made from the sources and by the programs."""
    folder = target / "reference"
    folder.mkdir(parents=True, exist_ok=True)
    pages = {
        "programs": reference_pages.programs(smartmill),
        "topics": reference_pages.topics(ROOT),
        "messages": reference_pages.messages(ROOT),
        "launch_files": reference_pages.launch_files(ROOT),
        "parameters": reference_pages.parameters(ROOT),
        "api": reference_pages.api(ROOT),
    }
    for name, text in pages.items():
        (folder / f"{name}.md").write_text(text, encoding="utf-8")
    effects = ROOT / "devel/lib/smartmill_studies/sim_effect_table"
    if effects.is_file():  # else the table of the page, which a test compares with the catalogue
        run([effects, target / "effects.md"])


def write_api(site):
    doxygen = shutil.which("doxygen")
    if not doxygen:
        print("build_site: doxygen is not installed: the C++ interface is left out (./setup --with-docs installs it)", file=sys.stderr)
        return
    settings = (ROOT / "docs/site/Doxyfile").read_text(encoding="utf-8") + f'OUTPUT_DIRECTORY = "{site}"\n'
    run([doxygen, "-"], input=settings, text=True)


def serve(site, port):
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=str(site))
    with http.server.ThreadingHTTPServer(("127.0.0.1", port), handler) as server:
        print(f"http://127.0.0.1:{server.server_port}/index.html")
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            pass


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, usage=argparse.SUPPRESS,
                                     add_help=False)
    parser.add_argument("-h", "--help", action="help", help=argparse.SUPPRESS)
    for option, settings in (("--smartmill", {}), ("--no-api", {"action": "store_true"}), ("--out", {"default": ROOT / "build/site"}),
                             ("--serve", {"type": int})):
        parser.add_argument(option, help=argparse.SUPPRESS, **settings)
    arguments = parser.parse_args()
    smartmill = arguments.smartmill or find_program(
        "smartmill", [ROOT / "devel/bin/smartmill", *(ROOT / "build_without_ros").glob("**/bin/smartmill")])
    if not smartmill:
        fail("the program smartmill was not found; build it with ./setup smartmill, or name it with --smartmill")
    if not shutil.which("mkdocs"):
        fail("mkdocs is not installed; ./setup --with-docs installs it")

    site = pathlib.Path(arguments.out).resolve()
    source = site.with_name(site.name + "_source")
    shutil.rmtree(source, ignore_errors=True)
    Collector(source).copy()
    write_reference(source, smartmill)
    settings = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    settings = re.sub(r"^docs_dir:.*$", f"docs_dir: {source}", settings, flags=re.MULTILINE)
    settings = re.sub(r"^site_dir:.*$", f"site_dir: {site}", settings, flags=re.MULTILINE)
    configuration = source.with_name(source.name + ".yml")
    configuration.write_text(settings, encoding="utf-8")
    run(["mkdocs", "build", "--strict", "--quiet", "--config-file", configuration], env={**os.environ, "PATH": "/usr/bin:" + os.environ["PATH"]})
    if not arguments.no_api:
        write_api(site)
    print(f"built: {site}/index.html")
    if arguments.serve is not None:
        serve(site, arguments.serve)


if __name__ == "__main__":
    main()
