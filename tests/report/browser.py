"""A real browser for the tests of pages: the machine's Chromium without a window, led by Playwright."""

import shutil
from importlib.util import find_spec
from pathlib import Path
from typing import Any

_NAMES = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM = next(filter(None, map(shutil.which, _NAMES)), None) if find_spec("playwright") else None
_PATIENCE = 60_000  # milliseconds that a page may take


class Browser:
    """One tab of a browser; a context manager.

    ``messages`` collects what the page wrote to the console, and the errors that it met; ``requests`` the addresses
    that it asked for. With ``webgl`` it draws in three dimensions, on the processor.
    """

    def __init__(self, folder: Path, *, webgl: bool = False):
        assert CHROMIUM, "chromium or playwright is not installed"
        from playwright.sync_api import sync_playwright

        drawing = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"] if webgl else ["--disable-gpu"]
        self._player = sync_playwright().start()
        self._context = self._player.chromium.launch_persistent_context(
            folder, executable_path=CHROMIUM, args=["--no-sandbox", "--disable-dev-shm-usage", *drawing]
        )
        self._page = self._context.new_page()
        self._page.set_default_timeout(_PATIENCE)
        # What a page's policy forbids to itself is not forbidden to the debugger: expressions are evaluated by it.
        self._debugger = self._context.new_cdp_session(self._page)
        self.messages: list[str] = []
        self.requests: list[str] = []
        self._page.on("console", lambda message: self.messages.append(message.text))
        self._page.on("pageerror", lambda error: self.messages.append(str(error)))
        self._page.on("request", lambda request: self.requests.append(request.url))

    def __enter__(self) -> "Browser":
        return self

    def __exit__(self, *_: object) -> None:
        self._context.close()
        self._player.stop()

    def open(self, path: Path, fragment: str = "") -> None:
        """Open a file, and wait until it is loaded."""
        self._page.goto("about:blank")
        self.messages.clear()
        self.requests.clear()
        self._page.goto(path.as_uri() + fragment)

    def ask(self, expression: str) -> Any:
        """Return the value of a JavaScript expression in the page; of a promise, what it comes to."""
        how = {"returnByValue": True, "awaitPromise": True, "userGesture": True}
        answer = self.call("Runtime.evaluate", expression=expression, **how)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def look_like(self, width: int, height: int, *, dark: bool = False) -> None:
        """Take the size of a screen (CSS pixels) and a colour scheme."""
        self._page.set_viewport_size({"width": width, "height": height})
        self._page.emulate_media(color_scheme="dark" if dark else "light")

    def screenshot(self, path: Path, *, whole: bool = True) -> None:
        """Write what is seen, or all of the page, as PNG."""
        self._page.screenshot(path=path, full_page=whole)

    def pdf(self) -> bytes:
        """Return the page as it prints."""
        return self._page.pdf(prefer_css_page_size=True)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command to the debugger and return its answer."""
        return self._debugger.send(method, parameters)
