"""`apollonius show`, `report`, `slice` and `play`: games and agents as pictures and pages, and in a
browser.
"""

import argparse
import tempfile
import webbrowser
from math import radians
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

from apollonius.agents.names import SHIELDED, SIDES
from apollonius.cli.options import (
    AGENT,
    add_game,
    add_game_options,
    chosen_rules,
    print_next_step,
    requested_match,
    shell_command,
    warn,
)
from apollonius.cli.values import (
    agent_of,
    existing_agent,
    new_file,
    new_folder,
    real_number,
    run_folder,
    whole_number,
)
from apollonius.io.errors import InvalidInput, require, require_extra
from apollonius.io.extensions import PLAYERS, extension_names
from apollonius.io.limits import MOVING, PORT, SEED

if TYPE_CHECKING:
    from apollonius.game.types import Role
    from apollonius.play.replay import Replay


def add_show(parser: argparse.ArgumentParser) -> None:
    about = f"{AGENT}; or a replay file alone"
    parser.add_argument("pursuer", type=agent_of("pursuer"), metavar="PURSUER|REPLAY", help=about)
    parser.add_argument(
        "evader",
        type=agent_of("evader"),
        metavar="EVADER",
        nargs="?",
        help="the other side's player",
    )
    add_game_options(parser)
    parser.add_argument(
        "--out",
        type=new_file(*MOVING, ".png", ".json", needs={}),
        default="game.gif",
        help="file to write: .png, .gif, .webp or a replay's .json (default: %(default)s)",
    )
    parser.add_argument(
        "--speed",
        type=real_number,
        help="seconds of the game in one of a moving picture (default: 1)",
    )
    parser.set_defaults(run=run_show, games=1, record=0)


def run_show(options: argparse.Namespace) -> int:
    from apollonius.play.replay import save_replay
    from apollonius.show import animation

    if options.speed is not None:
        moving = f"left out, as only {', '.join(MOVING)} move"
        require(options.out.suffix in MOVING, "--speed", options.speed, moving)
        bound = f"from {animation.SLOWEST:g} to {animation.FASTEST:g} times real time"
        is_possible = animation.SLOWEST <= options.speed <= animation.FASTEST
        require(is_possible, "--speed", options.speed, bound)
    display = options.display
    display.begin_task("playing one game")
    replay = _requested_replay(options)
    display.begin_task(f"drawing {len(replay.states)} states")
    if options.out.suffix == ".json":
        save_replay(replay, options.out)
    else:
        animation.save_animation(replay, options.out, options.speed or 1.0)
    display.stop()
    steps = f"{len(replay.actions)} steps, starts: {replay.game.starts.speed}"
    print(f"{replay.pursuer} against {replay.evader}: {replay.ending()} ({steps})")
    if options.out.suffix == ".json":
        then = shell_command("show", options.out, "--out", options.out.with_suffix(".gif"))
    elif options.evader is None:
        then = shell_command("play")
    else:
        then = shell_command(
            "evaluate", options.pursuer, options.evader, *chosen_rules(options), "--games", 1000
        )
    print_next_step(options, options.out, then=then)
    return 0


def _requested_replay(options: argparse.Namespace) -> "Replay":
    """Load the replay, or play one game between two players."""
    if options.evader is None:
        from apollonius.play.replay import load_replay

        replay = load_replay(Path(options.pursuer))
        first = replay.first_difference()
        if first is not None:
            options.display.print_line(f"played again, this game differs from step {first} on")
        return replay
    from apollonius.evaluate.match import record_game

    return record_game(requested_match(options, in_one_arena=True), 0)


def add_report(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=run_folder, metavar="RUN", help="folder of a training run")
    parser.add_argument(
        "--out", type=new_file(".html"), help="file to write, .html (default: RUN/report.html)"
    )
    parser.set_defaults(run=run_report)


def run_report(options: argparse.Namespace) -> int:
    folder: Path = options.folder
    out: Path = options.out or folder / "report.html"
    require_extra("plot", "report")
    from apollonius.show.report import report_of, save_report

    options.display.begin_task("playing games and drawing")
    save_report(report_of(folder), out)
    print_next_step(options, out, then=f"open {out} in a browser")
    return 0


def add_slice(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "agent", type=existing_agent, metavar="AGENT", help="one that values its actions"
    )
    parser.add_argument(
        "--opponent",
        type=real_number,
        nargs=2,
        required=True,
        metavar=("X", "Y"),
        help="where it is [m]",
    )
    parser.add_argument(
        "--opponent-speed", type=real_number, default=0.0, metavar="V", help="[m/s] (default: 0)"
    )
    parser.add_argument(
        "--opponent-heading", type=real_number, default=0.0, metavar="DEG", help="from the x axis"
    )
    parser.add_argument(
        "--speed",
        type=real_number,
        default=0.0,
        metavar="V",
        help="of the agent itself [m/s] (default: 0)",
    )
    parser.add_argument(
        "--heading",
        type=real_number,
        default=0.0,
        metavar="DEG",
        help="of the agent itself (default: 0)",
    )
    add_game(parser)
    parser.add_argument(
        "--out",
        type=new_file(".png"),
        default="slice.png",
        help="PNG to write (default: %(default)s)",
    )
    parser.set_defaults(run=run_slice)


def run_slice(options: argparse.Namespace) -> int:
    import jax.numpy as jnp

    from apollonius import BySide, RobotState, Role, find_player, load_solution
    from apollonius.agents.policy import AbstractActionValuePolicy
    from apollonius.arenas.charting import with_chart
    from apollonius.arenas.file import game_in_one_arena
    from apollonius.export.player import exported_side
    from apollonius.show.slices import save_slice
    from apollonius.solve.store import is_solution

    numbers = (*options.opponent, options.opponent_speed, radians(options.opponent_heading))
    opponent = RobotState(*(jnp.float32(number) for number in numbers))
    own = (options.speed, radians(options.heading))
    game = game_in_one_arena(options.game, "slice")
    path = Path(options.agent)
    role = (
        Role[load_solution(path).problem.role.upper()]
        if is_solution(path)
        else exported_side(options.agent)
    )
    agent = find_player(options.agent, role, game)
    nine = "one that values its nine actions, as those trained by DQN do"
    if not isinstance(agent.policy, AbstractActionValuePolicy):
        raise InvalidInput(f"agent = {options.agent} is not possible: it must be {nine}.")
    warn(options, game, [agent])
    game = with_chart(game, agent.policy.needs_chart)
    options.display.begin_task("asking the agent all over the arena")
    save_slice(agent.policy, role, agent.name, game, own, opponent, options.out)
    players, gif = BySide.of(role, options.agent, "random"), options.out.with_suffix(".gif")
    print_next_step(
        options,
        options.out,
        then=shell_command("show", *players, *chosen_rules(options), "--out", gif),
    )
    return 0


def add_play(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--as", dest="side", choices=SIDES, default="evader", help="your side (default: evader)"
    )
    parser.add_argument(
        "--against",
        type=existing_agent,
        metavar="AGENT",
        help="your opponent: a rule such as intercept, a zoo agent, a .safetensors file, "
        "PACKAGE:NAME, or a .wasm file "
        "of your own; shielded: may precede it (default: the best there is, a little slow to see)",
    )
    add_game(parser)
    parser.add_argument(
        "--seed",
        type=whole_number(SEED),
        default=0,
        help="seed of the starts (default: %(default)s)",
    )
    parser.add_argument(
        "--port",
        type=whole_number(PORT),
        help="of the page on this machine (default: the first free one)",
    )
    parser.add_argument(
        "--no-open", action="store_true", help="print the page's address, open no browser"
    )
    parser.add_argument(
        "--site", type=new_folder, metavar="DIR", help="write the page there, and serve nothing"
    )
    parser.set_defaults(run=run_play)


def run_play(options: argparse.Namespace) -> int:
    from apollonius import Role, find_game
    from apollonius.io.document import whole_folder
    from apollonius.web.site import choose_match, write_site

    options.display.begin_task("writing the page")
    side = Role[options.side.upper()]
    with tempfile.TemporaryDirectory() as private:
        folder = Path(private) / "site"  # which takes the mode of the page's own folder
        choice = choose_match(
            side, _opponent(options, side.other, Path(private)), options.game, options.seed
        )
        warn(options, find_game(options.game))
        if not options.site:
            write_site(folder, choice)
            return _serve(options, folder)
        empty = not options.site.exists() or (
            options.site.is_dir() and not any(options.site.iterdir())
        )
        require(empty, "--site", options.site, "a new or empty folder; choose another")
        with whole_folder(options.site) as folder:
            write_site(folder, choice)
        print_next_step(
            options,
            options.site,
            then=f"put it on any web host; its page is {options.site / 'index.html'}",
        )
        return 0


def _opponent(options: argparse.Namespace, role: "Role", folder: Path) -> str | None:
    """Return the opponent's name for the page: a player of another package becomes a file of the
    folder.
    """
    bare = (options.against or "").removeprefix(SHIELDED)
    if ":" not in bare or bare not in extension_names(PLAYERS):
        return options.against
    from apollonius import find_game, find_player
    from apollonius.web.programs import write_player

    path = folder / f"{bare.partition(':')[2]}.wasm"
    write_player(find_player(bare, role, find_game(options.game)).policy, path)
    return options.against.removesuffix(bare) + str(path)


def _serve(options: argparse.Namespace, folder: Path) -> int:
    from apollonius.web.server import make_server

    options.display.stop()
    with make_server(folder, options.port) as server:
        address = f"http://{server.server_address[0]}:{server.server_port}/"
        print(f"play at {address}  (Ctrl-C ends)", flush=True)
        if not options.no_open:
            Thread(
                target=webbrowser.open, args=(address,), daemon=True
            ).start()  # some end with their window
        server.serve_forever()
    return 0
