"""The site builds without a warning, its links lead somewhere, nothing is loaded from the network, and a browser finds words.

$SMARTMILL is the program, $SITE the folder of the site. Skipped where mkdocs or the browser is not installed. Screenshots stay in $SITE/screenshots.
"""
import functools
import html.parser
import http.server
import os
import pathlib
import re
import shutil
import subprocess
import sys
import threading
import unittest
import urllib.parse

DOCS = pathlib.Path(__file__).resolve().parents[1]
SITE = pathlib.Path(os.environ.get("SITE", "site_test")).resolve()
WIDTHS = {1400: 900, 900: 900, 400: 800}  # [px], and the height
WORDS = ("receptance", "FOCAS", "runout")
PAGES = ("index.html", "tutorials/tap_test.html", "reference/parameters.html", "hammer.html")


class Page(html.parser.HTMLParser):
    """Identifiers, links and loaded files of a page."""

    def __init__(self, text):
        super().__init__()
        self.identifiers, self.links, self.loaded = set(), [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        if values.get("id"):
            self.identifiers.add(values["id"])
        if tag == "a" and values.get("href"):
            self.links.append(values["href"])
        if tag in ("script", "img", "iframe") and values.get("src"):
            self.loaded.append(values["src"])
        if tag == "link" and values.get("href") and values.get("rel") != "canonical":
            self.loaded.append(values["href"])


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@unittest.skipUnless(shutil.which("mkdocs", path="/usr/bin"), "mkdocs is not installed (./setup --with-docs)")
class SiteTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.built = subprocess.run([DOCS / "build_site.py", "--smartmill", os.environ["SMARTMILL"], "--no-api", "--out", SITE],
                                   capture_output=True, text=True)
        cls.pages = {path: Page(path.read_text(encoding="utf-8")) for path in SITE.rglob("*.html")}

    def test_builds_without_a_warning(self):
        self.assertEqual(self.built.returncode, 0, self.built.stderr)
        self.assertEqual(self.built.stderr, "")
        self.assertGreater(len(self.pages), 40)

    def test_each_page_is_in_the_navigation(self):
        navigation = (DOCS.parent / "mkdocs.yml").read_text(encoding="utf-8")
        missing = [str(path.relative_to(DOCS)) for path in DOCS.rglob("*.md") if str(path.relative_to(DOCS)) not in navigation]
        self.assertEqual(missing, [])

    def test_links_lead_to_pages_and_headings(self):
        faults = []
        for path, page in self.pages.items():
            if path.name == "404.html":
                continue
            for link in page.links:
                address = urllib.parse.urlsplit(link)
                if address.scheme or address.netloc or "/api/" in link:
                    continue
                target = (path.parent / urllib.parse.unquote(address.path)).resolve() if address.path else path
                target = target / "index.html" if target.is_dir() else target
                if not target.exists():
                    faults.append(f"{path.relative_to(SITE)}: {link}: no such file")
                elif address.fragment and target in self.pages and urllib.parse.unquote(address.fragment) not in self.pages[target].identifiers:
                    faults.append(f"{path.relative_to(SITE)}: {link}: no such heading")
        self.assertEqual(faults, [])

    def test_loads_nothing_from_the_network(self):
        self.assertEqual([(path.name, file) for path, page in self.pages.items() for file in page.loaded if "//" in file], [])
        for sheet in SITE.rglob("*.css"):
            self.assertIsNone(re.search(r"url\([\"']?https?:", sheet.read_text(encoding="utf-8")), sheet)

    @unittest.skipUnless(shutil.which("chromium") and shutil.which("chromedriver"), "chromium or chromium-driver is not installed")
    def test_search_in_the_browser(self):
        sys.path.insert(0, str(DOCS.parent / "smartmill_panel/test/page"))
        from browser import Browser
        screenshots = SITE / "screenshots"
        screenshots.mkdir(exist_ok=True)
        with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(SITE))) as server, Browser() as browser:
            threading.Thread(target=server.serve_forever, daemon=True).start()
            self.addCleanup(server.shutdown)
            site = f"http://127.0.0.1:{server.server_port}"
            for width, height in WIDTHS.items():
                browser.resize(width, height)
                for page in PAGES:
                    browser.open(f"{site}/{page}")
                    browser.wait("document.querySelector('.md-content h1') !== null")
                    self.assertLessEqual(browser.js("document.documentElement.scrollWidth"), width, f"{page} at {width} px")
                    browser.picture(screenshots / f"{page.replace('/', '_')[:-5]}_{width}.png")
            for word in WORDS:
                browser.open(f"{site}/index.html?q={word}")
                browser.wait("document.querySelectorAll('.md-search-result__item').length > 0")
                found = browser.js("[...document.querySelectorAll('.md-search-result__item')].map(item => item.textContent).join(' ')")
                self.assertIn(word.lower(), found.lower())
                browser.picture(screenshots / f"search_{word}.png")
            self.assertEqual(browser.errors(), [])


if __name__ == "__main__":
    unittest.main()
