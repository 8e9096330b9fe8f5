"""A browser for tests: Debian's chromium and chromedriver with Python's standard library only."""
import base64
import json
import shutil
import socket
import subprocess
import tempfile
import time
import urllib.error
import urllib.request

FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage", "--hide-scrollbars"]
ELEMENT = "element-6066-11e4-a52e-4f735466cecf"
PATIENCE = 60.0  # [s] for a busy computer


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


class Browser:
    def __enter__(self):
        port = free_port()
        self.profile = tempfile.mkdtemp()
        self.driver = subprocess.Popen(["chromedriver", f"--port={port}", "--silent"], stdout=subprocess.DEVNULL,
                                       stderr=subprocess.DEVNULL)
        self.at = f"http://127.0.0.1:{port}"
        try:
            self._await_driver()
            options = {"binary": shutil.which("chromium"), "args": FLAGS + ["--user-data-dir=" + self.profile]}
            wanted = {"browserName": "chrome", "goog:loggingPrefs": {"browser": "ALL"}, "goog:chromeOptions": options}
            session = self.call("POST", "/session", {"capabilities": {"alwaysMatch": wanted}})
        except BaseException:
            self.__exit__()
            raise
        self.at += "/session/" + session["sessionId"]
        return self

    def _await_driver(self):
        end = time.time() + PATIENCE
        while True:
            try:
                return self.call("GET", "/status")
            except OSError:
                if time.time() > end:
                    raise
                time.sleep(0.05)

    def __exit__(self, *_):
        try:
            self.call("DELETE", "")
        except Exception:  # the session may have ended
            pass
        self.driver.terminate()
        self.driver.wait()
        shutil.rmtree(self.profile, ignore_errors=True)

    def call(self, method, path, body=None):
        data = json.dumps(body or {}).encode() if method == "POST" else None
        request = urllib.request.Request(self.at + path, data, {"Content-Type": "application/json"}, method=method)
        try:
            with urllib.request.urlopen(request, timeout=PATIENCE) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            raise AssertionError(json.load(error)["value"]["message"].splitlines()[0]) from error

    def open(self, url):
        self.call("POST", "/url", {"url": url})

    def js(self, code, *args):
        return self.call("POST", "/execute/sync", {"script": "return " + code, "args": list(args)})

    def wait(self, code, *args, seconds=PATIENCE):
        end = time.time() + seconds
        while True:
            value = self.js(code, *args)
            if value:
                return value
            if time.time() > end:
                raise AssertionError("timeout: " + code)
            time.sleep(0.05)

    def click(self, css):
        element = self.call("POST", "/element", {"using": "css selector", "value": css})[ELEMENT]
        self.call("POST", f"/element/{element}/click")

    def text(self, css):
        return self.js("document.querySelector(arguments[0])?.textContent", css)

    def resize(self, width, height):
        """Sets the size of the page, independent of the window."""
        emulated = {"cmd": "Emulation.setDeviceMetricsOverride",
                    "params": {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}}
        self.call("POST", "/goog/cdp/execute", emulated)

    def picture(self, file):
        with open(file, "wb") as out:
            out.write(base64.b64decode(self.call("GET", "/screenshot")))

    def errors(self):
        log = self.call("POST", "/se/log", {"type": "browser"})
        return [m["message"] for m in log if m["level"] == "SEVERE"]
