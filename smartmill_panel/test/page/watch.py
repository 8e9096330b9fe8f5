#!/usr/bin/env python3
"""Opens a panel during a session or a replay and waits until it has drawn the results.
usage: watch.py PORT PICTURE [TOPIC...]: exit code 0 once the topics have arrived and the views are drawn, without an error
on the console."""
import sys
import time
import urllib.request

from browser import PATIENCE, Browser

PORT, PICTURE, TOPICS = sys.argv[1], sys.argv[2], sys.argv[3:]
ADDRESS = f"http://127.0.0.1:{PORT}/"
DRAWN = "[...document.querySelectorAll('#view-' + arguments[0] + ' canvas')].every(c => c.dataset.drawn == 'yes')"


def main():
    with Browser() as browser:
        browser.resize(1280, 800)
        end = time.time() + PATIENCE
        while True:
            try:
                urllib.request.urlopen(ADDRESS, timeout=5).read()
                break
            except OSError:
                if time.time() > end:
                    raise
                time.sleep(0.1)
        browser.open(ADDRESS)
        browser.wait("!!window.smartmill")
        browser.wait("document.querySelector('#status').textContent.includes('Connected')")
        status = browser.text("#status")
        for topic in TOPICS:
            browser.wait("window.smartmill.link.message(arguments[0]) !== undefined", topic, seconds=300)
        for view in ("dynamics", "forces"):
            browser.js("(location.hash = arguments[0], 1)", view)
            browser.wait(DRAWN, view)
        browser.js("(location.hash = 'overview', 1)")
        browser.picture(PICTURE)
        # The panel may end with the replay before this script.
        errors = [e for e in browser.errors() if "WebSocket" not in e and "ERR_CONNECTION" not in e]
        assert not errors, errors
        print(status)


main()
