"""Scenarios: small situations that one side wins from a fixed start by a line of actions, which is
proved (`benchmarks/scenarios.py`), and agents that play them against many replies.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Int, UInt32

from apollonius.agents.onnx_agent import external_process
from apollonius.agents.policy import Memory
from apollonius.agents.pool import AbstractPlayers, ActionsAndMemory, Reader, RowBits, single_player
from apollonius.agents.source import NamedPlayer
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import from_dict, load_game
from apollonius.benchmark.track import find_entry
from apollonius.game.game import Game
from apollonius.game.outcome import PURSUER_WINS, evader_winning
from apollonius.game.teams import separation
from apollonius.game.types import ROLES, BySide, GameState, RobotState, Role
from apollonius.game.validation import MAX_SIZE
from apollonius.io.document import parse_json, read_bytes
from apollonius.io.errors import InvalidInput, require, require_printable
from apollonius.observe.observation import RAW_VIEW, RawView
from apollonius.play.playout import Report, no_report, play_out

FOLDER = Path(__file__).with_name("scenarios")
"""The files: of each scenario its game, `NAME.toml`, and all else, `NAME.json`."""
NAMES = tuple(sorted(path.stem for path in FOLDER.glob("*.json")))
"""All scenarios."""
MOST_HOLDS = 12
"""Most actions of a line."""
MOST_COARSE_HOLDS = 4
"""Most actions of a reply that agents play against: there are 9^4 replies then."""
Robots = tuple[tuple[float, float, float, float], ...]
"""A side's robots at the start: x, y [m], v [m/s], heading [rad] of each."""


@dataclass(frozen=True)
class BenchmarkScenario:
    """A situation that one side wins within the game's time limit.

    Attributes:
        task: the task in words.
        side: the side that wins.
        pursuers, evaders: robots at the start.
        line: the winning actions, for each robot of the side one for each hold.
        hold: control steps for which the line, and a reply that it is proved against, hold each
            action.
        coarse_hold: control steps for which replies hold each action that agents play against, a
            multiple of `hold`.
        name: of its files.
        game: the rules, packed.
    """

    task: str
    side: Literal["pursuer", "evader"]
    pursuers: Robots
    evaders: Robots
    line: tuple[tuple[int, ...], ...]
    hold: int
    coarse_hold: int
    name: str
    game: Game

    def __post_init__(self) -> None:
        require_printable("task", self.task)
        steps = int(self.game.max_steps)
        for field, hold, most in (
            ("hold", self.hold, MOST_HOLDS),
            ("coarse_hold", self.coarse_hold, MOST_COARSE_HOLDS),
        ):
            bound = f"a divisor of the {steps} steps of its game, {steps / most:g} at least"
            divides = hold > 0 and steps % hold == 0 and steps <= hold * most
            require(divides, field, hold, bound)
        bound = f"a multiple of hold = {self.hold}"
        require(self.coarse_hold % self.hold == 0, "coarse_hold", self.coarse_hold, bound)
        counts = f"{len(self.pursuers)} v {len(self.evaders)}"
        require(counts == self.game.size, "robots", counts, f"{self.game.size}, as in its game")
        numbers = [number for robot in (*self.pursuers, *self.evaders) for number in robot]
        farthest, bound = max(numbers, key=abs), f"within {MAX_SIZE:g} of 0"
        require(abs(farthest) <= MAX_SIZE, "a robot's number", farthest, bound)
        _require_possible_start(self.game, self.start)
        robots = len(self.game.bodies[self.role])
        holds = steps // self.hold
        fits = len(self.line) == robots
        fits = fits and all(len(actions) == holds for actions in self.line)
        fits = fits and {action for actions in self.line for action in actions} <= {*range(9)}
        require(fits, "line", "some", f"{robots} lists of {holds} actions from 0 to 8")

    @property
    def role(self) -> Role:
        return Role[self.side.upper()]

    @cached_property
    def start(self) -> GameState:
        """The initial state."""

        def states(robots: Robots) -> tuple[RobotState, ...]:
            return tuple(RobotState(*map(jnp.float32, numbers)) for numbers in robots)

        return GameState.at_start(BySide(self.pursuers, self.evaders).map(states))

    @property
    def goal(self) -> str:
        """The outcome that solves it, in words."""
        seconds = float(self.game.max_steps * self.game.dt)
        verb = "wins within" if self.role == Role.PURSUER else "survives"
        return f"{self.role.name.lower()} {verb} {seconds:g} s"

    @cached_property
    def replies(self) -> Int[np.ndarray, "replies holds"]:
        """All replies that agents play against: the other side's actions, one for each hold."""
        holds = int(self.game.max_steps) // self.coarse_hold
        return np.array(list(product(range(9), repeat=holds)), np.int32)

    def wins(self, outcomes: Int[Array | np.ndarray, "*games"]) -> Bool[np.ndarray, "*games"]:
        """Check which outcomes are wins of its side; the time limit is the evader's."""
        winning = BySide(PURSUER_WINS, evader_winning(time_limit_wins=True))
        return np.isin(outcomes, winning[self.role])

    def play(self, agent: NamedPlayer, report: Report = no_report) -> "ScenarioResult":
        """Play an agent of its side against every one of `replies`.

        Args:
            agent: The agent.
            report: Called with the games so far and in all.
        """
        games = len(self.replies)
        courses = np.repeat(self.replies, self.coarse_hold, axis=1)
        players = BySide.of(self.role, single_player(agent.policy), Replies(jnp.asarray(courses)))
        starts = jax.tree.map(lambda leaf: jnp.repeat(leaf[None], games, axis=0), self.start)
        rules = with_chart(self.game, agent.policy.needs_chart)
        process = external_process(agent.policy)
        if process:
            process.start_round(games)
        results = play_out(rules, players, starts, jax.random.key(0), games, report=report)
        is_won = self.wins(results.outcome)
        if process:
            process.stop()
            is_won[[*process.forfeited]] = False
        return ScenarioResult(
            scenario=self.name,
            goal=self.goal,
            replies=games,
            won=int(is_won.sum()),
            failure=process.reason if process else "",
        )


@dataclass(frozen=True)
class ScenarioResult:
    """The replies that an agent won against; it solves the scenario if it won against all."""

    scenario: str
    goal: str
    replies: int
    won: int
    failure: str

    @property
    def is_solved(self) -> bool:
        return self.won == self.replies


class Replies(AbstractPlayers):
    """Fixed courses of actions of one robot; the first game of a batch meets the first course."""

    courses: Int[Array, "courses steps"]

    @property
    def observation(self) -> RawView:
        return RAW_VIEW

    @property
    def memory(self) -> Int[Array, ""]:
        """The number of steps played."""
        return jnp.zeros((), jnp.int32)

    def sample(self, bits: UInt32[Array, " games"]) -> Int[Array, " games"]:
        return jnp.minimum(jnp.arange(len(bits), dtype=jnp.int32), len(self.courses) - 1)

    def act(
        self, member: Int[Array, " rows"], read: Reader, rows: Any, memory: Memory, bits: RowBits
    ) -> ActionsAndMemory:
        return self.courses[member, memory], memory + 1


def find_scenarios(role: Role, names: Sequence[str] | None = None) -> list[BenchmarkScenario]:
    """Load the scenarios of these names or `.json` files, or all, that a side wins.

    Raises:
        InvalidInput: For an unknown name, where none is the side's, and as `load_scenario`.
    """
    scenarios: list[BenchmarkScenario] = []
    for name in names or NAMES:
        is_file = name.endswith(".json")
        require(is_file or name in NAMES, "scenario", name, f"a .json file, or {', '.join(NAMES)}")
        scenarios.append(load_scenario(Path(name) if is_file else FOLDER / f"{name}.json"))
    of_side = [scenario for scenario in scenarios if scenario.role == role]
    listed = ", ".join(scenario.name for scenario in scenarios)
    bound = f"with one at least that the {role.name.lower()} wins"
    require(of_side, "scenarios", listed, bound)
    return of_side


def play_scenarios(
    name: str, scenarios: Sequence[BenchmarkScenario], report: Report = no_report
) -> list[ScenarioResult]:
    """Play an agent in scenarios of its side, but those whose game it does not play.

    Args:
        name: Name or file of the agent.
        scenarios: One at least.
        report: Called with the games so far and in all.

    Raises:
        InvalidInput: As `find_entry`, where it plays in no scenario.
    """
    results: list[ScenarioResult] = []
    refusal: InvalidInput | None = None
    total = sum(len(scenario.replies) for scenario in scenarios)
    before = 0
    for scenario in scenarios:
        try:
            agent = find_entry(name, scenario.role, scenario.game)
        except InvalidInput as error:
            refusal = error
        else:
            results.append(
                scenario.play(agent, lambda games, _, first=before: report(first + games, total))
            )
        before += len(scenario.replies)
    if refusal and not results:
        raise refusal
    return results


def load_scenario(path: Path) -> BenchmarkScenario:
    """Load a scenario from its `.json` file, beside which its game lies as `.toml`.

    Raises:
        InvalidInput: If a file is missing or no scenario's, and as `load_game`.
    """
    about = f"'{path}' is no scenario; correct it"
    data = parse_json(read_bytes(path, "a scenario's .json file", "check the path"), about)
    own = {"name": path.stem, "game": load_game(path.with_suffix(".toml")).packed()}
    return from_dict(BenchmarkScenario, data | own, f"'{path}'")


def _require_possible_start(game: Game, start: GameState) -> None:
    """Require a game that a line can be proved in, and robots that have not failed yet."""
    game.require_one_arena("a scenario")
    game.require_no_movers("a scenario")
    require(game.drives is None, "drives", "some", "left out: its robots act at once")
    for role in ROLES:
        for body, robot in zip(game.bodies[role], start.robots[role], strict=True):
            is_free = game.arena.clearance(robot.x, robot.y) > body.radius
            is_in_limits = jnp.clip(robot.v, body.v_min, body.v_max) == robot.v
            place = f"({float(robot.x):g}, {float(robot.y):g})"
            bound = "in free space, and within its limits of speed"
            require(is_free & is_in_limits, role.name.lower(), place, bound)
    gaps = [separation(*pair) for pair in product(*start.robots)]
    is_apart = min(map(float, gaps)) > game.capture_distance
    bound = "farther from each pursuer than the capture distance"
    require(is_apart, "evader", "captured", bound)
