"""`apollonius play`: the game in a browser, against a trained agent."""

import argparse
import tempfile
import webbrowser
from pathlib import Path

from apollonius.cli.options import add_game, finish, warn
from apollonius.cli.values import count, known_agent, new_folder
from apollonius.io.limits import PORT, SEED

PLAYER = (
    "a rule such as intercept, a zoo agent, a .safetensors file, or a .wasm file of your own; shielded: may precede it"
)
"""Help for an argument that names a player of the page."""


def add_play(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--as", dest="side", choices=("evader", "pursuer"), default="evader", help="your side (default: %(default)s)"
    )
    parser.add_argument(
        "--against",
        type=known_agent,
        metavar="AGENT",
        help=f"your opponent: {PLAYER} (default: the best there is, a little slow to see)",
    )
    add_game(parser)
    parser.add_argument("--seed", type=count(SEED), default=0, help="seed of the starts (default: %(default)s)")
    parser.add_argument(
        "--port", type=count(PORT), help="port of the page on this machine (default: the first free one)"
    )
    parser.add_argument("--no-open", action="store_true", help="print the page's address, open no browser")
    parser.add_argument(
        "--site",
        type=new_folder,
        metavar="DIR",
        help="write the page to this folder, for a web host, and serve nothing",
    )
    parser.set_defaults(run=run_play)


def run_play(options: argparse.Namespace) -> int:
    from apollonius.arenas.file import find_game
    from apollonius.game.types import Role
    from apollonius.io.document import whole_folder
    from apollonius.io.errors import require
    from apollonius.web.server import make_server
    from apollonius.web.site import choose, write_site

    options.display.begin("writing the page")
    choice = choose(Role[options.side.upper()], options.against, options.game, options.seed)
    warn(options, find_game(options.game))
    if options.site:
        empty = not options.site.exists() or (options.site.is_dir() and not any(options.site.iterdir()))
        require(empty, "--site", options.site, "a new or empty folder; choose another")
        with whole_folder(options.site) as folder:
            write_site(folder, choice)
        options.display.end()
        finish(options.site, then=f"put it on any web host; its page is {options.site / 'index.html'}")
        return 0
    with tempfile.TemporaryDirectory() as private:
        folder = Path(private) / "site"  # which takes the mode of the page's own folder
        write_site(folder, choice)
        options.display.end()
        with make_server(folder, options.port) as server:
            address = f"http://{server.server_address[0]}:{server.server_port}/"
            print(f"play at {address}  (Ctrl-C ends)", flush=True)
            if not options.no_open:
                webbrowser.open(address)
            server.serve_forever()
    return 0
