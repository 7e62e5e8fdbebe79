"""How long the browser page loads, its frames and its agents' moves take: `python benchmarks/page.py [--seconds 30]`.

In headless Chromium, found on the path: the first level from a server and from a folder; two shielded agents in the
paper's arena, five there and two in an office with all layers on. Needs the extra `dev`. A frame is the page's own work
for it: steps, drawing, figures. What else the machine does counts too, so run it on an idle one.
"""

import argparse
import json
import shutil
import sys
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

from playwright.sync_api import Browser, Page, sync_playwright

from apollonius.web.server import make_server
from website.playground import write_playground

FLAGS = ("--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update")
CASES = {
    "two agents": ("?pursuer=shielded:P_pool&evader=shielded:E_curriculum", False),
    "three hunt two, all layers": ("?pursuer=shielded:pursuer&evader=shielded:evader&game=team-3v2", True),
    "all layers, office": ("?pursuer=shielded:pursuer&evader=shielded:evader&game=office", True),
}
"""What is opened, and whether all layers are on."""
TIMED = """() => {
  const durations = { frame: [], interval: [], move: [] };
  const timed = (kind, work) => (...given) => {
    const begun = performance.now();
    const result = work(...given);
    durations[kind].push(performance.now() - begun);
    return result;
  };
  const next = requestAnimationFrame;
  let last = performance.now();
  globalThis.requestAnimationFrame = (work) => next((now) => {
    durations.interval.push(now - last);
    last = now;
    timed("frame", work)(now);
  });
  for (const player of Object.values(apollonius.page.match.players).flat()) player.act = timed("move", player.act);
  globalThis.p95 = (kind) => durations[kind].sort((a, b) => a - b)[Math.ceil(0.95 * durations[kind].length) - 1];
}"""
"""Keeps how long frames and moves take from now on [ms]."""


def measure(page: Page, seconds: float) -> dict[str, float]:
    """Return 95th percentiles [ms] of `seconds` of play."""
    for _ in range(round(10 * seconds)):
        if page.inner_text("#go") != "Pause":
            page.click("#go")
        page.wait_for_timeout(100)
    return {
        "frame_ms_p95": page.evaluate("p95('frame')"),
        "between_frames_ms_p95": page.evaluate("p95('interval')"),
        "agent_move_ms_p95": page.evaluate("p95('move')"),
    }


def load(browser: Browser, address: str, folder: Path) -> dict[str, float | str]:
    """Return how much is loaded until the first level can be started, and how long that takes."""
    asked: set[str] = set()
    page = browser.new_page()
    page.on("request", lambda request: asked.add(urlsplit(request.url).path.removeprefix(str(folder)).strip("/")))
    page.goto(address)
    page.wait_for_selector("#go:enabled")
    ready = page.evaluate("performance.now()")
    page.close()
    loaded = sum((folder / (name or "index.html")).stat().st_size for name in asked)
    return {"case": urlsplit(address).scheme, "ready_ms": ready, "loaded_MB": loaded / 1e6}


def measure_all(browser: Browser, address: str, folder: Path, seconds: float) -> Iterator[dict[str, float | str]]:
    """Yield the figures of each case."""
    yield load(browser, address, folder)
    yield load(browser, (folder / "index.html").as_uri(), folder)
    for name, (query, has_layers) in CASES.items():
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(address + query)
        page.wait_for_selector("#go:enabled")
        page.evaluate(TIMED)
        if has_layers:
            page.click("#why")
        yield {"case": name} | measure(page, seconds)
        page.close()


def main() -> None:
    """Serve the page, measure, print."""
    parser = argparse.ArgumentParser(description="How long the page's frames and moves take.")
    parser.add_argument("--seconds", type=float, default=30.0)
    options = parser.parse_args()
    chromium = shutil.which("chromium")
    if chromium is None:
        sys.exit("needs chromium on the path: apt-get install chromium")
    with tempfile.TemporaryDirectory() as name, sync_playwright() as driver:
        folder = Path(name)
        write_playground(folder)
        browser = driver.chromium.launch(executable_path=chromium, args=[*FLAGS])
        with make_server(folder) as server:
            threading.Thread(target=server.serve_forever, daemon=True).start()
            for figures in measure_all(browser, f"http://localhost:{server.server_port}/", folder, options.seconds):
                print(json.dumps(figures), flush=True)
            server.shutdown()
        browser.close()


if __name__ == "__main__":
    main()
