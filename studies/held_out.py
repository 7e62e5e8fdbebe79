"""How good are the players of any arena where nobody trained them, beside those who know the arena?

    python -m studies.held_out --out runs/held_out

solves the game in some held-out arenas of `suite-v1`, trains a pursuer and an evader in each, finds the classical
player that is best in them, and lets attackers try to beat each of them, and the solved game's own player, and `P_any`
and `E_any`.
Written are `held_out.json` and `held_out.md`. Stopped or killed at any point, the same command goes on where it was.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import chain, zip_longest
from pathlib import Path

import jax.numpy as jnp

from apollonius.agents.kind import Named
from apollonius.agents.trained import ANY
from apollonius.arenas.charting import charted
from apollonius.arenas.scenarios import each_alone, scenario_game
from apollonius.arenas.suite import suite_entries
from apollonius.cache import content
from apollonius.catalogue import SHIELDED, find_player
from apollonius.errors import exit_status
from apollonius.evaluate.match_cache import kept_record
from apollonius.exploit.attack import Attack
from apollonius.exploit.attackers import QUICK, Attacker, Means
from apollonius.exploit.losses import Losses
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.jobs import Job, ShouldStop
from apollonius.learn.config import PRESETS, RunConfig
from apollonius.learn.folder import agent_file
from apollonius.reproduce.finding import Finding
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.solving import kept_tables
from studies import driver
from studies.worst import SOLVED, SPECIALIST, arena_table, read_attacks, verdict

SUITE = "suite-v1"
CLASSICAL = BySide(("pure-pursuit", "intercept"), ("flee", "flee-aware"))
"""Of whom the best is taken, behind a shield."""
KINDS = ("table", "foresight-1")
"""Attackers, by their names in `apollonius.exploit.attackers`; those with more foresight take longer than all else."""
IGNORANT = 1
"""Those of them that do not ask the player what it would do. A shield, and the solved game's player, take too long to
answer the others."""


@dataclass(frozen=True)
class Siege(Attack):
    """An attack on a player that is at hand, in a game that is."""

    named: Named | None = None
    played: Game | None = None

    @cached_property
    def rules(self) -> Game:
        """The game that is played."""
        assert self.played is not None
        return self.played

    @cached_property
    def player(self) -> Named:
        """The attacked player."""
        assert self.named is not None
        return self.named


@dataclass(frozen=True, kw_only=True)
class HeldOut(driver.AbstractStudy):
    """Solved tables, a training and attacks in each of some held-out arenas."""

    name = "held_out"
    games: int = driver.option(100, help="games in each match of the classical players (default: %(default)s)")
    attacks: int = driver.option(50, help="games with each attacker (default: %(default)s)")
    arenas: int = driver.option(20, help="how many: kinds take turns (default: %(default)s)")
    longest: float = driver.option(12.0, help="their longer side at most, for the grid is coarse [m]")
    grid: str = driver.option("11x11x5x8", help="nodes along x, y, v and heading (default: %(default)s)")
    preset: str = driver.option("standard", help="how the specialists train (default: %(default)s)")
    seed: int = driver.option(0, help="of the starts")

    @cached_property
    def chosen(self) -> list[str]:
        """The names of the arenas."""
        found = [one for one in suite_entries(SUITE, "held-out") if max(one.width, one.height) <= self.longest]
        kinds = [[one.name for one in found if one.kind == kind] for kind in dict.fromkeys(one.kind for one in found)]
        turns = chain.from_iterable(zip_longest(*kinds))
        return [name for name in turns if name][: self.arenas]

    @cached_property
    def together(self) -> Game:
        """The game in all of them."""
        return scenario_game(f"{SUITE}/{','.join(self.chosen)}")

    def trainings(self) -> driver.Trainings:
        """The specialists of each arena."""
        configs = [RunConfig(**{**vars(PRESETS[self.preset]), "game": game}) for game in each_alone(self.together)]
        return {
            self.out / name: (config, tuple(driver.LAST)) for name, config in zip(self.chosen, configs, strict=True)
        }

    def jobs(self) -> Iterator[Sequence[Job]]:
        """The matches of the classical players in all arenas, then the attacks in each."""
        yield [Job(f"the classical players, {role.name.lower()}s", best_classical, (self, role)) for role in Role]
        yield [Job(f"the attacks in {name}", judge, (self, number)) for number, name in enumerate(self.chosen)]

    def kept(self, arena: str) -> Path:
        """Where the attacks in an arena are kept."""
        return self.out / arena / "attacks"

    def finding(self) -> Finding:
        """What each loses, and at most is sure of."""
        found = {arena: read_attacks(self.kept(arena)) for arena in self.chosen}
        text = "\n\n".join(f"{arena_table(found, role)}\n\n{verdict(found, role)}" for role in Role)
        data = {
            arena: {
                side: {player: {by: one.to_dict() for by, one in each.items()} for player, each in players.items()}
                for side, players in attacks.items()
            }
            for arena, attacks in found.items()
        }
        return Finding("Players of any arena where nobody trained them", text, data={"arenas": data})


def judge(study: HeldOut, number: int, should_stop: ShouldStop) -> bool:
    """Attack everyone in one arena; what was done is kept. Returns False if it was stopped."""
    arena = study.chosen[number]
    alone, scenario = each_alone(study.together)[number], study.together.scenario
    assert scenario is not None
    # All have one shape, so that what is compiled for one arena serves all.
    game = charted(scenario.game(study.together, jnp.asarray(number)))
    counts = [int(part) for part in study.grid.split("x")]
    tables = kept_tables(alone, counts, study.out / "tables", played=game)
    for role in Role:
        attacks = [Siege(role, one.name, named=one, played=game) for one in _players(study, arena, game, tables, role)]
        for attack in attacks:
            for attacker in _attackers(study, arena, attack, tables):
                if should_stop():
                    return False
                _kept_losses(study, arena, attack, attacker)
    return True


def _players(study: HeldOut, arena: str, game: Game, tables: BySide[SaddlePolicy], role: Role) -> Iterator[Named]:
    yield find_player(ANY[role], role, game)
    yield _specialist(study, arena, game, role)
    yield find_player(_classical(study, role), role, game)
    yield Named(SOLVED, tables[role])


def _specialist(study: HeldOut, arena: str, game: Game, role: Role) -> Named:
    return Named(SPECIALIST, find_player(str(agent_file(study.out / arena, driver.LAST[role])), role, game).policy)


def best_classical(study: HeldOut, role: Role, should_stop: ShouldStop) -> bool:
    """Play each of the classical players in all arenas; what was done is kept. Returns False if it was stopped."""
    del should_stop  # some minutes
    _classical(study, role)
    return True


def _classical(study: HeldOut, role: Role) -> str:
    """The one that comes off best against the other side's player of any arena, behind a shield."""
    found: dict[str, float] = {}
    for name in (f"shielded:{name}" for name in CLASSICAL[role]):
        asked = {"role": role.name.lower(), "player": name, "arenas": study.chosen, "games": study.games}

        def play(name: str = name) -> Losses:
            game = charted(study.together)
            attack = Siege(role, name, named=find_player(name, role, game), played=game)
            against = Attacker(ANY[role.other], find_player(ANY[role.other], role.other, game).policy)
            return against.measure(attack, study.games, study.seed)

        losses = kept_record(study.out / "classical", f"{role.name.lower()}--{name}.json", asked, Losses, play)
        found[name] = losses.wins - losses.loses
    return max(found, key=lambda name: found[name])


def _attackers(study: HeldOut, arena: str, attack: Siege, tables: BySide[SaddlePolicy]) -> Iterator[Attacker]:
    means = Means(tables, study.out / arena / "responses")
    asks = attack.player.name != SOLVED and not attack.player.name.startswith(SHIELDED)
    for kind in KINDS if asks else KINDS[:IGNORANT]:
        yield from QUICK[kind](attack, means)
    other = attack.role.other
    yield Attacker(ANY[other], find_player(ANY[other], other, attack.rules).policy)


def _kept_losses(study: HeldOut, arena: str, attack: Siege, attacker: Attacker) -> Losses:
    asked = {
        "role": attack.role.name.lower(),
        "player": attack.player.name,
        "content": content(attack.player.policy),
        "attacker": attacker.name,
        "games": study.attacks,
        "grid": study.grid,
        "seed": study.seed,
    }
    name = f"{asked['role']}--{attack.player.name}--{attacker.name}.json"
    return kept_record(
        study.kept(arena), name, asked, Losses, lambda: attacker.measure(attack, study.attacks, study.seed)
    )


main = partial(driver.main, HeldOut)

if __name__ == "__main__":
    sys.exit(exit_status(main))
