"""How long the browser page's frames and its agents' moves take: `python benchmarks/page.py [--seconds 30]`.

Two shielded agents play in headless Chromium, found on the path; needs the extra `dev`. A frame is the page's own
work for it: steps, drawing, figures. What else the machine does counts too, so run it on an idle one.
"""

import argparse
import json
import shutil
import sys
import tempfile
import threading
from pathlib import Path

from playwright.sync_api import sync_playwright

from apollonius.web.server import make_server
from apollonius.web.site import Choice, write_site

FLAGS = ("--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update")
CHOICE = Choice(pursuer="shielded:P_pool", evader="shielded:E_curriculum")


def measure(address: str, chromium: str, seconds: float) -> dict[str, float]:
    """95th percentiles [ms] while games go on for so many seconds."""
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium, args=[*FLAGS])
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(address)
        page.wait_for_selector("#go:enabled")
        for _ in range(round(10 * seconds)):
            if page.inner_text("#go") != "Pause":
                page.click("#go")
            page.wait_for_timeout(100)
        timing = page.evaluate(
            "Object.fromEntries(Object.entries(apollonius.timing).map(([what, timing]) => [what, timing.p95]))"
        )
        browser.close()
    return {
        "frame_ms_p95": timing["frame"],
        "between_frames_ms_p95": timing["interval"],
        "agent_move_ms_p95": timing["move"],
    }


def main() -> None:
    """Serve the page, measure, print."""
    parser = argparse.ArgumentParser(description="How long the page's frames and moves take.")
    parser.add_argument("--seconds", type=float, default=30.0)
    options = parser.parse_args()
    chromium = shutil.which("chromium")
    if chromium is None:
        sys.exit("needs chromium on the path: apt-get install chromium")
    with tempfile.TemporaryDirectory() as folder:
        write_site(Path(folder), CHOICE)
        with make_server(Path(folder)) as server:
            threading.Thread(target=server.serve_forever, daemon=True).start()
            print(json.dumps(measure(f"http://localhost:{server.server_port}/", chromium, options.seconds)))
            server.shutdown()


if __name__ == "__main__":
    main()
