"""A headless Chromium, driven by the DevTools protocol, for tests of pages."""

import asyncio
import base64
import json
import os
import pathlib
import shutil
import signal
import subprocess
import tempfile
import time
import urllib.request

import tornado.websocket

NAMES = ("chromium-headless-shell", "chromium", "google-chrome")
PATIENCE = 30.0  # s; only a failure takes as long


def find_browser():
    """Its path; None where there is none."""
    return next(filter(None, map(shutil.which, NAMES)), None)


class Browser:
    """One page. `complaints` has the errors and warnings of the page."""

    def __init__(self, url, width=1440, height=900):
        self._folder = tempfile.TemporaryDirectory(prefix="browser_", ignore_cleanup_errors=True)
        self.downloads = pathlib.Path(self._folder.name, "downloads")
        self.downloads.mkdir()
        self.complaints = []
        self._process = subprocess.Popen(
            [find_browser(), "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
             "--disable-dev-shm-usage", "--no-first-run", "--remote-debugging-port=0",
             f"--window-size={width},{height}", f"--user-data-dir={self._folder.name}/profile",
             "about:blank"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            start_new_session=True)  # it is a script that starts many
        self._loop = asyncio.new_event_loop()
        self._count = 0
        page = next(target for target in self._targets() if target["type"] == "page")
        self._socket = self._await(lambda: tornado.websocket.websocket_connect(
            page["webSocketDebuggerUrl"], max_message_size=1 << 28))
        self.ask("Page.enable")
        self.ask("Runtime.enable")
        self.ask("Log.enable")
        self.ask("Emulation.setDeviceMetricsOverride", width=width, height=height,
                 deviceScaleFactor=1, mobile=False)
        self.ask("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(self.downloads))
        self.open(url)

    def _await(self, begin):
        async def wait():
            return await asyncio.wait_for(begin(), PATIENCE)

        return self._loop.run_until_complete(wait())

    def _targets(self):
        port = pathlib.Path(self._folder.name, "profile", "DevToolsActivePort")
        end = time.monotonic() + PATIENCE
        while True:
            try:
                number = port.read_text(encoding="ascii").split()[0]
                with urllib.request.urlopen(f"http://127.0.0.1:{number}/json/list") as answer:
                    return json.load(answer)
            except (OSError, IndexError):
                if time.monotonic() > end or self._process.poll() is not None:
                    raise
                time.sleep(0.05)

    def ask(self, method, **parameters):
        """One command of the protocol; its result."""
        self._count += 1
        number = self._count
        self._socket.write_message(json.dumps({"id": number, "method": method,
                                               "params": parameters}))
        while True:
            answer = self._await(self._socket.read_message)
            if answer is None:
                raise ConnectionError("the browser has gone")
            words = json.loads(answer)
            if words.get("id") == number:
                if "error" in words:
                    raise RuntimeError(f"{method}: {words['error']}")
                return words["result"]
            self._note(words)

    def _note(self, event):
        if event.get("method") == "Runtime.exceptionThrown":
            details = event["params"]["exceptionDetails"]
            self.complaints.append(details.get("exception", {}).get("description")
                                   or details["text"])
        elif event.get("method") == "Log.entryAdded" and \
                event["params"]["entry"]["level"] == "error":
            self.complaints.append(event["params"]["entry"]["text"])

    def open(self, url):
        self.ask("Page.navigate", url=url)
        self.wait("document.readyState == 'complete'", "the page")

    def run(self, script):
        """The value of an expression of JavaScript."""
        result = self.ask("Runtime.evaluate", expression=script, returnByValue=True,
                          awaitPromise=True)
        if "exceptionDetails" in result:
            raise AssertionError(f"{script}: {result['exceptionDetails']}")
        return result["result"].get("value")

    def wait(self, script, what, patience=PATIENCE):
        """The first value of the expression that is true."""
        end = time.monotonic() + patience
        while True:
            value = self.run(script)
            if value:
                return value
            if time.monotonic() > end:
                raise AssertionError(f"waited in vain for {what}; {self.complaints}")
            time.sleep(0.02)

    def text(self, selector):
        return self.run(f"document.querySelector({json.dumps(selector)}).textContent")

    def click(self, selector):
        """With the mouse, in its middle: what is hidden or covered is not hit."""
        box = self.run(f"(() => {{ const e = document.querySelector({json.dumps(selector)}); "
                       "e.scrollIntoView({block: 'nearest'}); const b = e.getBoundingClientRect(); "
                       "return [b.x + b.width / 2, b.y + b.height / 2]; })()")
        self.drag(*box, *box)

    def drag(self, x0, y0, x1, y1):
        for kind, x, y, buttons in (("mouseMoved", x0, y0, 0), ("mousePressed", x0, y0, 1),
                                    ("mouseMoved", x1, y1, 1), ("mouseReleased", x1, y1, 0)):
            self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, buttons=buttons,
                     button="none" if kind == "mouseMoved" and not buttons else "left",
                     clickCount=0 if kind == "mouseMoved" else 1)

    def picture(self, path):
        data = self.ask("Page.captureScreenshot", format="png")["data"]
        pathlib.Path(path).write_bytes(base64.b64decode(data))

    def close(self):
        self._socket.close()
        os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self._loop.close()
        self._folder.cleanup()
