"""The film of the README: the page's "Watch it learn", taken in headless Chromium by a clock that
this script turns.

python -m website.film docs/figures/learning.gif
"""

import argparse
import io
import shutil
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, ViewportSize, sync_playwright

from apollonius.web.server import make_server
from apollonius.web.site import write_site

SCREEN = ViewportSize(width=1280, height=632)
SECONDS = 12.0
PER_SECOND = 8
"""Frames of the film, and so of the page's time."""
COLOURS = 128


def frames(page: Page) -> Iterator[Image.Image]:
    """Yield what the page shows, frame by frame."""
    for _ in range(round(SECONDS * PER_SECOND)):
        page.clock.run_for(1000 // PER_SECOND)
        yield Image.open(io.BytesIO(page.screenshot())).convert("RGB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as browsers:
        write_site(Path(folder) / "site")
        browser = browsers.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        page = browser.new_context(viewport=SCREEN, color_scheme="dark").new_page()
        page.clock.install(time=0)
        page.clock.pause_at(1)
        with make_server(Path(folder) / "site") as server:
            threading.Thread(target=server.serve_forever, daemon=True).start()
            page.goto(f"http://localhost:{server.server_port}/?level=3")
            page.wait_for_selector("#go:enabled")
            pictures = list(frames(page))
            server.shutdown()
        browser.close()
    palette = pictures[-1].quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    film = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    film[0].save(
        options.out, save_all=True, append_images=film[1:], duration=1000 // PER_SECOND, loop=0
    )


if __name__ == "__main__":
    main()
