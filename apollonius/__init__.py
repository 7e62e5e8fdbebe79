"""Apollonius learns, solves and plays pursuit-evasion games between mobile robots among obstacles.

The public names are imported when they are first used, so that `import apollonius` and `apollonius --help` are quick.
"""

import importlib
from typing import TYPE_CHECKING, Any

from apollonius.version import __version__ as __version__

if TYPE_CHECKING:
    from apollonius.adapters.pettingzoo import parallel_env as parallel_env
    from apollonius.agents.greedy import EpsilonGreedy as EpsilonGreedy
    from apollonius.agents.greedy import Greedy as Greedy
    from apollonius.agents.kind import Named as Named
    from apollonius.agents.policy import AbstractPolicy as AbstractPolicy
    from apollonius.agents.pool import solo as solo
    from apollonius.agents.pool import stack as stack
    from apollonius.agents.shield import shielded as shielded
    from apollonius.agents.store import load_agent as load_agent
    from apollonius.agents.store import save_agent as save_agent
    from apollonius.catalogue import find_player as find_player
    from apollonius.evaluate.card import measure_card as measure_card
    from apollonius.evaluate.match import Match as Match
    from apollonius.evaluate.match import StartFilter as StartFilter
    from apollonius.evaluate.match import play_match as play_match
    from apollonius.evaluate.match import record_game as record_game
    from apollonius.evaluate.regret import measure_regret as measure_regret
    from apollonius.game.arena import Arena as Arena
    from apollonius.game.arena import Disc as Disc
    from apollonius.game.by_side import BySide as BySide
    from apollonius.game.dynamics import Unicycle as Unicycle
    from apollonius.game.game import Game as Game
    from apollonius.game.game import reset_batch as reset_batch
    from apollonius.game.polygon import Polygon as Polygon
    from apollonius.game.presets import make_game as make_game
    from apollonius.game.reward import Reward as Reward
    from apollonius.game.starts import Starts as Starts
    from apollonius.game.types import GameState as GameState
    from apollonius.game.types import Outcome as Outcome
    from apollonius.game.types import RobotState as RobotState
    from apollonius.game.types import Role as Role
    from apollonius.observe.registry import find_observation as find_observation
    from apollonius.observe.view import look as look
    from apollonius.playout import play_at_once as play_at_once
    from apollonius.playout import play_out as play_out
    from apollonius.replay import load_replay as load_replay
    from apollonius.replay import save_replay as save_replay
    from apollonius.rollout import collect as collect
    from apollonius.solve.contest import make_contest as make_contest
    from apollonius.solve.guarantee import make_duel as make_duel
    from apollonius.solve.guarantee import solve_duel as solve_duel
    from apollonius.solve.players import SaddlePolicy as SaddlePolicy
    from apollonius.solve.reach import make_chase as make_chase
    from apollonius.solve.reach import solve_reach as solve_reach
    from apollonius.solve.reference import joint_grid as joint_grid
    from apollonius.solve.reference import reference_grid as reference_grid
    from apollonius.solve.safety import kernel_shielded as kernel_shielded
    from apollonius.solve.safety import solve_safety as solve_safety
    from apollonius.solve.store import load_solution as load_solution
    from apollonius.solve.table_policy import TablePolicy as TablePolicy

_HOMES = {
    "adapters.pettingzoo": ("parallel_env",),
    "agents.greedy": ("EpsilonGreedy", "Greedy"),
    "agents.kind": ("Named",),
    "agents.policy": ("AbstractPolicy",),
    "agents.pool": ("solo", "stack"),
    "agents.shield": ("shielded",),
    "agents.store": ("load_agent", "save_agent"),
    "catalogue": ("find_player",),
    "evaluate.card": ("measure_card",),
    "evaluate.match": ("Match", "StartFilter", "play_match", "record_game"),
    "evaluate.regret": ("measure_regret",),
    "game.arena": ("Arena", "Disc"),
    "game.by_side": ("BySide",),
    "game.dynamics": ("Unicycle",),
    "game.game": ("Game", "reset_batch"),
    "game.polygon": ("Polygon",),
    "game.presets": ("make_game",),
    "game.reward": ("Reward",),
    "game.starts": ("Starts",),
    "game.types": ("GameState", "Outcome", "RobotState", "Role"),
    "observe.registry": ("find_observation",),
    "observe.view": ("look",),
    "playout": ("play_at_once", "play_out"),
    "replay": ("load_replay", "save_replay"),
    "rollout": ("collect",),
    "solve.contest": ("make_contest",),
    "solve.guarantee": ("make_duel", "solve_duel"),
    "solve.players": ("SaddlePolicy",),
    "solve.reach": ("make_chase", "solve_reach"),
    "solve.reference": ("joint_grid", "reference_grid"),
    "solve.safety": ("kernel_shielded", "solve_safety"),
    "solve.store": ("load_solution",),
    "solve.table_policy": ("TablePolicy",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}
__all__ = sorted(_HOME_OF)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'apollonius' has no attribute '{name}'")
    return getattr(importlib.import_module(f"apollonius.{_HOME_OF[name]}"), name)


def __dir__() -> list[str]:
    return __all__
