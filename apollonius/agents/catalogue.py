"""Agents by name: the built-in players, the zoo that ships with the package, and files."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from apollonius.agents.chasing import Intercept, ProportionalNavigation, PurePursuit
from apollonius.agents.classical import AbstractClassical, Still
from apollonius.agents.fleeing import Circle, Flee, FleeAware
from apollonius.agents.greedy import Greedy
from apollonius.agents.guarding import Territory
from apollonius.agents.network import Network, QNetwork
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import Pool, solo, stack
from apollonius.agents.potential import PotentialField
from apollonius.agents.shield import shielded
from apollonius.agents.squashed import SquashedMean
from apollonius.agents.store import Agent, AgentHeader, load_agent
from apollonius.agents.trained import at_best, exploring
from apollonius.agents.uniform import Uniform
from apollonius.errors import InvalidInput, require
from apollonius.game.game import Game
from apollonius.game.types import Role

ZOO = Path(__file__).parent.parent / "zoo"
"""Where the trained agents that ship with the package lie."""

BUILT_IN: dict[str, Callable[[], AbstractPolicy]] = {"random": Uniform, "still": Still}
"""Players that need no file, know no game and play either side."""
CLASSICAL: dict[str, tuple[type[AbstractClassical], tuple[Role, ...]]] = {
    "pure-pursuit": (PurePursuit, (Role.PURSUER,)),
    "proportional-navigation": (ProportionalNavigation, (Role.PURSUER,)),
    "intercept": (Intercept, (Role.PURSUER,)),
    "potential-field": (PotentialField, (Role.PURSUER, Role.EVADER)),
    "flee": (Flee, (Role.EVADER,)),
    "flee-aware": (FleeAware, (Role.EVADER,)),
    "circle": (Circle, (Role.EVADER,)),
    "territory": (Territory, (Role.PURSUER, Role.EVADER)),
}
"""Players that need no file but the game they play, and the sides that they can play."""
_FROM_ZOO = "zoo/"
"""Before the name of a trained agent that ships with the package, where it could be taken for another."""
_AGENTS = "agents"
"""The folder of a training run that its agents lie in."""
_RUNS = Path("runs")
"""The folder that training runs lie in unless they were put elsewhere."""
SHIELDED = "shielded:"
"""Before a player's name: the same, behind a shield."""


@dataclass(frozen=True)
class Named:
    """A player, what it is called, and the header of its file if it has one."""

    name: str
    policy: AbstractPolicy
    header: AgentHeader | None = None


def fingerprint(policy: AbstractPolicy) -> str:
    """What tells a player from others of its name: its kind, and a hash of all its numbers."""
    leaves = jax.tree.leaves(policy)
    return f"{type(policy).__name__} {sha256(b''.join(np.asarray(leaf).tobytes() for leaf in leaves)).hexdigest()}"


def zoo_names() -> list[str]:
    """Names of the agents that ship with the package."""
    return sorted(path.stem for path in ZOO.glob("*.safetensors"))


def find_agent(name: str, role: Role, game: Game | None = None) -> Named:
    """The player of this name: built in, in the zoo, or a file; greedy if it was trained.

    Args:
        name: `shielded:` before it puts the player behind a shield (`apollonius.agents.shield`). `RUN/NAME` is an agent
            of a training run, by the run's folder or its name among `runs`; `zoo/NAME` is one of the zoo.
        role: the side it is to play.
        game: what is played, which shields and classical players have to know.

    Raises:
        InvalidInput: when there is none, its file is bad, it was trained for the other side, or a shield cannot help.
    """
    if name.startswith(SHIELDED):
        bare = find_agent(name.removeprefix(SHIELDED), role, game)
        return replace(bare, name=SHIELDED + bare.name, policy=shielded(bare.policy, _known(game, name), role))
    if name in BUILT_IN:
        return Named(name, BUILT_IN[name]())
    if name in CLASSICAL:
        kind, sides = CLASSICAL[name]
        side = role.name.lower()
        require(role in sides, side, f"'{name}'", f"another player, as this one plays the {sides[0].name.lower()} only")
        return Named(name, kind.for_side(_known(game, name), role))
    agent, path = _load(name, role, [*BUILT_IN, *CLASSICAL, *zoo_names()])
    return Named(name if name.startswith(_FROM_ZOO) else called(path), at_best(agent.network), agent.header)


def called(path: Path) -> str:
    """What the agent of a file is called: RUN/NAME in the folder of a training run, else as the file.

    Two runs give their agents the same names, and those of the zoo.
    """
    return f"{path.resolve().parents[1].name}/{path.stem}" if path.parent.name == _AGENTS else path.stem


def find_pool(names: Sequence[str], role: Role, game: Game | None = None) -> Pool:
    """The pool of the players of these names; each game meets one of them.

    Several must be trained agents with networks of one shape, or `random`.

    Raises:
        InvalidInput: as `find_agent`, for no name, and for players that do not go together.
    """
    side, listed = f"{role.name.lower()}s", ", ".join(names)
    require(names, side, "none", "one player at least")
    policies = [find_agent(name, role, game).policy for name in names]
    if len(policies) == 1:
        return solo(policies[0])
    networks = [policy.network for policy in policies if isinstance(policy, Greedy | SquashedMean)]
    bound = "one player, or trained agents with networks of one shape, and random beside discrete ones"
    together = all(isinstance(policy, Greedy | SquashedMean | Uniform) for policy in policies)
    alike = len({tuple(leaf.shape for leaf in jax.tree.leaves(network)) for network in networks}) == 1
    require(together and alike, side, listed, bound)
    if not any(isinstance(policy, Uniform) for policy in policies):
        return stack([exploring(network, jnp.asarray(0.0)) for network in networks])
    require(isinstance(networks[0], QNetwork), side, listed, bound)
    # One structure for all: whoever explores always is random, whatever its network.
    return stack(
        [
            exploring(policy.network, jnp.asarray(0.0))
            if isinstance(policy, Greedy)
            else exploring(networks[0], jnp.asarray(1.0))
            for policy in policies
        ]
    )


def load_network(name: str, role: Role) -> Network:
    """The network of a trained agent, by its name in the zoo or its file.

    Raises:
        InvalidInput: as `find_agent`.
    """
    return _load(name, role, zoo_names())[0].network


def player_names(role: Role, game: Game) -> list[str]:
    """Names of all the players of one side that need no file and that the game is one for."""
    classical = [name for name, (kind, sides) in CLASSICAL.items() if role in sides and kind.fits(game)]
    return [*BUILT_IN, *classical, *[name for name in zoo_names() if name[0] == role.name[0]]]


def _known(game: Game | None, name: str) -> Game:
    if game is None:
        raise InvalidInput(f"'{name}' needs a game that it knows: give one, or name a player that needs none.")
    return game


def find_trained(name: str) -> tuple[Agent, Path]:
    """The trained agent of this name, in the zoo or a file, and where its file is.

    Raises:
        InvalidInput: when there is none, or its file is bad.
    """
    return _find(name, zoo_names())


def find_valued(name: str) -> tuple[Greedy, Agent, Path]:
    """The player of a trained agent that values the nine actions, the agent and its file.

    Raises:
        InvalidInput: as `find_trained`, and for one whose actions are continuous.
    """
    agent, path = find_trained(name)
    player = at_best(agent.network)
    if not isinstance(player, Greedy):
        raise InvalidInput(f"'{name}' has continuous actions and values none: name an agent trained by DQN.")
    return player, agent, path


def _load(name: str, role: Role, known: Sequence[str]) -> tuple[Agent, Path]:
    agent, path = _find(name, known)
    if agent.header.role != role.name.lower():
        raise InvalidInput(
            f"'{name}' plays the {agent.header.role}, not the {role.name.lower()}: the pursuer is named first, "
            "the evader second."
        )
    return agent, path


def _find(name: str, known: Sequence[str]) -> tuple[Agent, Path]:
    """A trained agent and its file; `known` are the names that a refusal offers."""
    in_zoo = name.removeprefix(_FROM_ZOO)
    run, _, agent = name.rpartition("/")
    in_run = [folder / _AGENTS / f"{agent}.safetensors" for folder in (Path(run), _RUNS / run) if run and agent]
    if in_zoo in zoo_names():
        path = ZOO / f"{in_zoo}.safetensors"
    elif Path(name).suffix == ".safetensors" or Path(name).exists():
        path = Path(name)
    elif any(file.is_file() for file in in_run):
        path = next(file for file in in_run if file.is_file())
    else:
        raise InvalidInput(
            f"no agent is called '{name}': choose one of {', '.join(known)}, or give a .safetensors file, or RUN/NAME "
            "for an agent of a training run."
        )
    return load_agent(path), path
