"""Firefox without a window, told what to do by its own protocol, Marionette: lengths and JSON over a socket."""

import json
import shutil
import socket
import subprocess
import time
from contextlib import contextmanager

import pytest

FIREFOX = shutil.which("firefox-esr") or shutil.which("firefox")
needs_firefox = pytest.mark.skipif(FIREFOX is None, reason="needs firefox")
PATIENCE = 60
"""How long [s] anything may take on a busy machine."""
PREFERENCES = """
user_pref("marionette.port", {port});
user_pref("browser.shell.checkDefaultBrowser", false);
user_pref("datareporting.policy.dataSubmissionEnabled", false);
user_pref("network.captive-portal-service.enabled", false);
user_pref("network.connectivity-service.enabled", false);
user_pref("app.update.disabledForTesting", true);
user_pref("extensions.systemAddon.update.enabled", false);
user_pref("browser.download.folderList", 2);
user_pref("browser.download.dir", "{downloads}");
user_pref("browser.download.alwaysOpenPanel", false);
"""


class Firefox:
    """One tab; commands are those of WebDriver."""

    def __init__(self, port, downloads):
        self.downloads = downloads
        self.socket = self._connected(port)
        self.stream = self.socket.makefile("rb")
        self._read()
        self.count = 0
        self.ask("NewSession", {"capabilities": {"alwaysMatch": {"acceptInsecureCerts": False}}})

    def _connected(self, port):
        for _ in range(10 * PATIENCE):
            try:
                return socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)
            except ConnectionRefusedError:
                time.sleep(0.1)
        raise TimeoutError("firefox does not listen")

    def _read(self):
        length = b""
        while (digit := self.stream.read(1)) != b":":
            length += digit
        return json.loads(self.stream.read(int(length)))

    def ask(self, command, parameters=None):
        self.count += 1
        content = json.dumps([0, self.count, f"WebDriver:{command}", parameters or {}]).encode()
        self.socket.sendall(f"{len(content)}:".encode() + content)
        _, number, error, answer = self._read()
        assert number == self.count
        assert error is None, error
        return answer

    def open(self, address):
        self.ask("Navigate", {"url": address})

    def evaluate(self, expression):
        """The value of an expression in the page."""
        return self.ask("ExecuteScript", {"script": f"return {expression}", "args": [], "sandbox": None})["value"]

    def wait_for(self, expression):
        """Until an expression in the page is true."""
        for _ in range(10 * PATIENCE):
            if self.evaluate(expression):
                return
            time.sleep(0.1)
        raise TimeoutError(expression)

    def keys(self, *events):
        """Keys go down (`keyDown`) and up (`keyUp`): pairs of an event and a key."""
        actions = [{"type": event, "value": key} for event, key in events]
        self.ask("PerformActions", {"actions": [{"type": "key", "id": "keyboard", "actions": actions}]})

    def drag(self, start, end):
        """The mouse, pressed at one place [px] and released at another."""
        (first, *ways) = [{"type": "pointerMove", "x": round(x), "y": round(y)} for x, y in (start, end)]
        actions = [first, {"type": "pointerDown", "button": 0}, *ways, {"type": "pointerUp", "button": 0}]
        self.ask("PerformActions", {"actions": [{"type": "pointer", "id": "mouse", "actions": actions}]})

    def click(self, selector):
        """The middle of an element."""
        box = self.evaluate(f"document.querySelector('{selector}').getBoundingClientRect().toJSON()")
        middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        self.drag(middle, middle)

    def choose(self, selector, path):
        """A file for an input."""
        (element,) = self.ask("FindElement", {"using": "css selector", "value": selector})["value"].values()
        self.ask("ElementSendKeys", {"id": element, "text": str(path)})

    def download(self, selector):
        """What comes of a click on an element: the file, whole."""
        before = {*self.downloads.iterdir()}
        self.click(selector)
        for _ in range(10 * PATIENCE):
            new = {*self.downloads.iterdir()} - before
            if new and not any(path.suffix == ".part" or path.stat().st_size == 0 for path in new):
                return new.pop()
            time.sleep(0.1)
        raise TimeoutError("nothing is saved")


@contextmanager
def opened(folder):
    """A browser with a profile of its own in a folder."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    downloads = folder / "downloads"
    downloads.mkdir()
    (folder / "user.js").write_text(PREFERENCES.format(port=port, downloads=downloads))
    command = [FIREFOX, "--headless", "--no-remote", "--profile", str(folder), "--marionette"]
    environment = {"HOME": str(folder), "MOZ_REMOTE_SETTINGS_DEVTOOLS": "0", "PATH": "/usr/bin:/bin"}
    process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        tab = Firefox(port, downloads)
        with tab.socket, tab.stream:
            yield tab
    finally:
        process.terminate()
        process.wait(PATIENCE)
