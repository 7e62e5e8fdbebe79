"""`apollonius regret`: how far a pursuer is from optimal play."""

import argparse
import json
import sys
from typing import Any

from apollonius.commands.options import AGENT, add_game_options, add_grid_options, requested_game, requested_grid
from apollonius.errors import require


def add_regret(subparsers: Any) -> None:
    """The parser of `regret`."""
    parser = subparsers.add_parser("regret", help="how far a pursuer is from the fastest capture of a standing target")
    parser.add_argument("pursuer", metavar="PURSUER", help=AGENT)
    parser.add_argument("--games", type=int, default=10_000, help="number of games (default: %(default)s)")
    parser.add_argument("--targets", type=int, default=20, help="places of the target (default: %(default)s)")
    add_game_options(parser)
    add_grid_options(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    parser.set_defaults(run=run_regret)


def run_regret(options: argparse.Namespace) -> int:
    """Measure and print."""
    from apollonius.agents.catalogue import find_agent
    from apollonius.evaluate.regret import measure_regret
    from apollonius.game.types import Role
    from apollonius.solve.reach import make_chase
    from apollonius.terminal import regret_table

    require(options.starts != "viable", "--starts", options.starts, "rest or moving; the table says what can be had")
    game = requested_game(options)
    pursuer = find_agent(options.pursuer, Role.PURSUER, game)
    grid, hold = requested_grid(options, game, Role.PURSUER)

    def report(done: int) -> None:
        print(f"target {done} of {options.targets} solved and played", file=sys.stderr, flush=True)

    chase = make_chase(game, grid, hold)
    regret = measure_regret(chase, pursuer.policy, options.games, options.targets, options.seed, report)
    if options.json:
        about = {"pursuer": pursuer.name, "game": options.game, "starts": options.starts, "seed": options.seed}
        print(json.dumps(about | {"grid": list(grid.counts), "hold": hold} | regret.to_dict()))
    else:
        print(regret_table(pursuer.name, regret))
    return 0
