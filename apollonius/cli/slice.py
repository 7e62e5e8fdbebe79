"""`apollonius slice`: what a trained agent, or a solved game, values and does all over the arena."""

import argparse
from math import radians
from pathlib import Path

from apollonius.cli.options import add_game, chosen_rules, command, finish, warn
from apollonius.cli.values import known_agent, new_file, real
from apollonius.io.errors import InvalidInput


def add_slice(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "agent", type=known_agent, metavar="AGENT", help="a zoo agent, or a .safetensors file, of solve game too"
    )
    parser.add_argument(
        "--opponent", type=real, nargs=2, required=True, metavar=("X", "Y"), help="where the other robot is [m]"
    )
    parser.add_argument("--opponent-speed", type=real, default=0.0, metavar="V", help="[m/s] (default: 0)")
    parser.add_argument(
        "--opponent-heading", type=real, default=0.0, metavar="DEG", help="from the x axis, leftwards (default: 0)"
    )
    parser.add_argument("--speed", type=real, default=0.0, metavar="V", help="of the agent itself [m/s] (default: 0)")
    parser.add_argument("--heading", type=real, default=0.0, metavar="DEG", help="of the agent itself (default: 0)")
    add_game(parser)
    parser.add_argument("--out", type=new_file(".png"), default="slice.png", help="PNG to write (default: %(default)s)")
    parser.set_defaults(run=run_slice)


def run_slice(options: argparse.Namespace) -> int:
    import jax.numpy as jnp

    from apollonius.agents.kind import Named
    from apollonius.agents.policy import AbstractActionValuePolicy
    from apollonius.agents.trained import find_trained, greedy
    from apollonius.arenas.charting import charted
    from apollonius.arenas.file import game_in_one_arena
    from apollonius.game.by_side import BySide
    from apollonius.game.types import RobotState, Role
    from apollonius.show.slices import save_slice
    from apollonius.solve.solving import table_player
    from apollonius.solve.store import is_solution

    numbers = (*options.opponent, options.opponent_speed, radians(options.opponent_heading))
    opponent = RobotState(*(jnp.float32(number) for number in numbers))
    own = (options.speed, radians(options.heading))
    game = game_in_one_arena(options.game, "slice")
    if is_solution(Path(options.agent)):
        path, player = Path(options.agent), table_player(Path(options.agent), game)
        role, header = player.zero_sum_game.role, None
    else:
        agent, path = find_trained(options.agent)
        player, role, header = greedy(agent.network), Role[agent.header.role.upper()], agent.header
        if not isinstance(player, AbstractActionValuePolicy):
            raise InvalidInput(
                f"'{options.agent}' has continuous actions and values none: name an agent trained by DQN."
            )
    warn(options, game, [Named(path.stem, player, header)])
    if player.charted:
        game = charted(game)
    options.display.begin("asking the agent all over the arena", compiles=True)
    save_slice(player, role, path.stem, game, own, opponent, options.out)
    options.display.end()
    players = BySide.of(role, options.agent, "random")
    finish(
        options.out, then=command("show", *players, *chosen_rules(options), "--out", options.out.with_suffix(".gif"))
    )
    return 0
