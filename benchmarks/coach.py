"""Whether the page is right about until when a lost game could have been saved:
`python benchmarks/coach.py OUT`.

People of five kinds flee on the page, see late and blunder, until 50 games of each of its levels
have ended in a capture. The page names the last moment of each game at which an agent in the
person's place would have stayed free for 10 s. A planner that knows the opponent is played from
every half second before the end, the last one first, until it stays free for 10 s. Page and planner
agree where their moments differ by 0.5 s at most, or where neither finds one within 20 s.

What the planner does not save could have been saved by a better one: its moment is a lower bound,
as the page's is. `page_later` counts games in which the page saves what the planner does not.
Needs Node.js. OUT is read first, so that a planner's moments of the same games count again. Half
an hour of a core.
"""

import argparse
import json
import subprocess
import tempfile
import time
from hashlib import sha256
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from half_seconds import AHEAD, HOLD, Played, filled
from jaxtyping import Array, Float, Int
from knowing_planner import TOGETHER, KnowingPlanner, plan_and_play

from apollonius.agents.policy import AbstractPolicy, AbstractWrapper, Memory
from apollonius.agents.source import NamedPlayer
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import from_dict
from apollonius.catalogue import find_player
from apollonius.evaluate.statistics import wilson_interval
from apollonius.exploit.attackers import FOLLOWED, planner_against
from apollonius.game.game import Game
from apollonius.game.outcome import PURSUER_WINS
from apollonius.game.types import GameState, Outcome, RandomBits, RobotState, Role
from apollonius.observe.view import View
from apollonius.solve.players import batch_actions
from apollonius.web.site import write_site

OPPONENT = "shielded:pursuer"
"""Opponent of all games, the page's own."""
PEOPLE = [
    {"name": "flee", "share_blunders": 0.2},
    {"name": "flee-aware", "share_blunders": 0.2},
    {"name": "E_curriculum", "share_blunders": 0.2},
    {"name": "evader", "share_blunders": 0.2},
    {"name": "evader", "share_blunders": 0.5},
]
"""Players that flee, and the shares of half seconds in which they act by chance."""
LATE = {"gentle": 1.0, "fair": 0.5, "sharp": 0.0}
"""Reaction delay of the opponent [s], by the page's difficulty."""
LEVELS = [
    {"arena": "paper", "difficulty": "fair", "seconds": 100},
    {"arena": "paper", "difficulty": "gentle", "seconds": 40},
    {"arena": "paper", "difficulty": "sharp", "seconds": 100},
    {"arena": "blocks", "difficulty": "fair", "seconds": 60},
]
"""The page's default game, and its levels 2, 9 and 6."""
FREE = 20
"""Half seconds for which an evader has to stay free."""
FARTHEST = 40
"""Half seconds before the end, at most, of moments that are tried."""
NEAR = 0.5
"""Difference of moments that agree [s]."""
PLANNED = "planner", "planner_seconds", "same_replies"
"""What a row has from the planner."""
Row = dict[str, Any]
"""Results of a level; `games` is a digest of the games that the planner was played in."""


class SeesLate(AbstractWrapper[AbstractPolicy]):
    """Another player without a memory, which sees its opponent where it was some steps ago."""

    steps: int = eqx.field(static=True)

    @property
    def memory(self) -> Float[Array, "steps 4"]:
        """The opponent's states in the last steps: x, y, v, heading."""
        return jnp.zeros((self.steps, 4))

    def __call__(
        self, view: View, memory: Float[Array, "steps 4"], bits: RandomBits
    ) -> tuple[Int[Array, ""], Float[Array, "steps 4"]]:
        oldest = RobotState(*memory[0])
        late_view = eqx.tree_at(lambda view: view.opponents[0].state, view, oldest)
        action, _ = self.policy(self.policy.observation(late_view), (), bits)
        latest = jnp.stack(jax.tree.leaves(view.opponent.state))
        return action, jnp.concatenate([memory, latest[None]])[1:]


class LostGame:
    """A game that an evader lost by a capture, and what the page says of it."""

    def __init__(self, record: dict[str, Any], steps_late: int) -> None:
        self.record = record
        self.rows = np.asarray(record["states"], np.float32)
        self.end = len(self.rows) - 1
        self.steps_late = steps_late

    def at(self, number: int) -> tuple[tuple[RobotState, RobotState], Memory]:
        """Return the robots in a state, and what the opponent remembers then."""
        row = jnp.asarray(self.rows[number])
        before = np.arange(number - self.steps_late, number)
        memory = jnp.asarray(self.rows[np.maximum(before, 0), 4:]) if self.steps_late else ()
        return (RobotState(*row[:4]), RobotState(*row[4:])), memory

    @property
    def page_seconds(self) -> float | None:
        """The page's moment in seconds before the end; None for never."""
        moment = self.record["moment"]
        return None if moment is None else (self.end - moment) / 10


def play_on_page(levels: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Play the games of all levels on the page's modules."""
    with tempfile.TemporaryDirectory() as folder:
        write_site(Path(folder))
        question = json.dumps({"site": folder, "levels": levels})
        program = ["node", str(Path(__file__).with_suffix(".mjs"))]
        done = subprocess.run(
            program, input=question, stdout=subprocess.PIPE, text=True, check=True
        )
    return json.loads(done.stdout)


def make_planner(game: Game, late: float, more: int) -> KnowingPlanner:
    """Make the evader that knows the opponent, which sees late by some time [s]; it draws `more`
    times as many courses as usual, and follows the page's stand-in, too.
    """
    policy = find_player(OPPONENT, Role.PURSUER, game).policy
    steps = round(late / float(game.dt))
    agent = NamedPlayer(OPPONENT, SeesLate(policy, steps) if steps else policy)
    followed = [*FOLLOWED.evader, "shielded:evader"]
    bare = planner_against(agent, Role.PURSUER, game, followed)
    parts = bare.game, bare.opponent, bare.followed, bare.role, more * bare.drawn
    return KnowingPlanner(*parts, bare.steps, bare.every)


def share_same(planner: KnowingPlanner, lost: list[LostGame]) -> float:
    """Return the share of steps in which the planner's opponent acts as the page's did."""

    @eqx.filter_jit
    def act(
        planner: KnowingPlanner, robots: tuple[RobotState, RobotState], memory: Memory
    ) -> Array:
        states = jax.vmap(GameState.of_two)(*robots, steps=jnp.zeros(len(replies), jnp.int32))
        bits = jnp.zeros(len(replies), jnp.uint32)
        game, opponent = planner.game, planner.opponent
        return batch_actions(opponent, game, states, Role.PURSUER, memory, bits)[0]

    moments = [(game, step) for game in lost for step in range(0, game.end, HOLD)]
    replies = [game.record["replies"][step] for game, step in moments]
    robots, memory = stacked([game.at(step) for game, step in moments])
    return float(np.mean(np.asarray(act(planner, robots, memory)) == replies))


def stacked(trees: list[Any]) -> Any:
    """Return a batch of several trees."""
    return jax.tree.map(lambda *leaves: jnp.stack([*map(jnp.asarray, leaves)]), *trees)


class Trial:
    """The planner's game from a moment of a lost game, each time from an earlier one, until it is
    saved.
    """

    def __init__(self, lost: LostGame, max_steps: int, steps: int) -> None:
        self.lost, self.max_steps, self.steps = lost, max_steps, steps
        self.is_over = False
        self.seconds: float | None = None
        self.back = 0
        self.restart()

    def restart(self) -> None:
        """Begin half a second earlier."""
        self.back += 1
        number = self.lost.end - HOLD * self.back
        if number < 0 or self.back > FARTHEST:
            self.is_over = True
            return
        robots, memory = self.lost.at(number)
        self.half_seconds = 0
        self.most = min(FREE, -(-(self.max_steps - number) // HOLD))
        self.played = Played(robots, jnp.int32(Outcome.ONGOING), memory)
        self.previous = np.full(self.steps, AHEAD, np.int32)

    def go_on(self, played: Played, previous: Array) -> None:
        """Go on after half a second."""
        self.played, self.previous = played, previous
        self.half_seconds += 1
        if np.isin(played.outcome, PURSUER_WINS):
            self.restart()
        elif played.outcome != Outcome.ONGOING or self.half_seconds == self.most:
            self.is_over = True
            self.seconds = self.back / 2


def last_chances(
    planner: KnowingPlanner, lost: list[LostGame], max_steps: int
) -> list[float | None]:
    """Find the last half second of each lost game from which the planner saves it.

    Args:
        planner: it knows the opponent.
        lost: the games.
        max_steps: their time limit, which an evader may reach before it has been free for 10 s.

    Returns:
        Seconds before the end of each game; None for one that it saves nowhere.
    """
    trials = [Trial(game, max_steps, planner.steps) for game in lost]
    for turn in range(FREE * FARTHEST):
        ongoing = [trial for trial in trials if not trial.is_over]
        if not ongoing:
            break
        for first in range(0, len(ongoing), TOGETHER):
            block = ongoing[first : first + TOGETHER]
            rows = [block[row] for row in filled(np.arange(len(block)), TOGETHER)]
            played = stacked([trial.played for trial in rows])
            previous = stacked([trial.previous for trial in rows])
            key = jax.random.fold_in(jax.random.key(turn), first)
            after = jax.device_get(plan_and_play(planner, played, previous, key))
            for row, trial in enumerate(block):
                trial.go_on(*jax.tree.map(lambda leaf, row=row: leaf[row], after))
    return [trial.seconds for trial in trials]


def count(pairs: list[tuple[float | None, float | None]]) -> dict[str, Any]:
    """Count the games in which page and planner agree, and the directions of their differences."""
    agreeing = page_earlier = page_later = 0
    for page, planner in pairs:
        ahead = (page or np.inf) - (planner or np.inf) if page != planner else 0.0
        agreeing += abs(ahead) <= NEAR
        page_earlier += ahead > NEAR
        page_later += ahead < -NEAR
    low, high = wilson_interval(agreeing, len(pairs))
    return {
        "number": len(pairs),
        "agreeing": agreeing,
        "share": round(agreeing / len(pairs), 3),
        "interval": [round(low, 3), round(high, 3)],
        "page_earlier": page_earlier,
        "page_later": page_later,
    }


def plan(level: dict[str, Any], record: dict[str, Any], more: int) -> dict[str, Any]:
    """Return the planner's moments in the lost games of a level, and what they cost."""
    rules = with_chart(from_dict(Game, record["game"], "a game of the page"))
    late = LATE[level["difficulty"]]
    games = [LostGame(loss, round(late / float(rules.dt))) for loss in record["lost"]]
    planner = make_planner(rules, late, more)
    began = time.process_time()
    moments = last_chances(planner, games, int(rules.max_steps))
    seconds = (time.process_time() - began) / len(games)
    share = share_same(planner, games)
    return {"planner": moments, "planner_seconds": round(seconds, 1), "same_replies": share}


def compare(level: dict[str, Any], record: dict[str, Any], planned: dict[str, Any]) -> Row:
    """Compare the page's moments in the lost games of a level with the planner's."""
    losses = record["lost"]
    page = [LostGame(loss, 0).page_seconds for loss in losses]
    return {
        **{name: level[name] for name in ("arena", "difficulty", "seconds", "seed")},
        "played": record["played"],
        **count([*zip(page, planned["planner"], strict=True)]),
        "page_milliseconds": [round(loss["milliseconds"]) for loss in losses],
        "people": [loss["person"] for loss in losses],
        "page": page,
        **planned,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--games", type=int, default=50, help="lost games of each level")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--more", type=int, default=1, help="times as many courses of the planner")
    options = parser.parse_args()
    text = options.out.read_text(encoding="utf-8") if options.out.exists() else '{"levels": []}'
    before = {row["games"]: row for row in json.loads(text)["levels"]}
    counts = {"number": options.games, "most": 20 * options.games, "seed": options.seed}
    levels = [level | counts | {"people": PEOPLE} for level in LEVELS]
    print("the page plays", flush=True)
    rows: list[Row] = []
    for level, record in zip(levels, play_on_page(levels), strict=True):
        states = json.dumps([loss["states"] for loss in record["lost"]])
        games = sha256(f"{states} {options.more}".encode()).hexdigest()
        if games in before:
            planned = {name: before[games][name] for name in PLANNED}
        else:
            planned = plan(level, record, options.more)
        rows.append({"games": games} | compare(level, record, planned))
        print({name: rows[-1][name] for name in ("arena", "difficulty", "share")}, flush=True)
        pairs = [pair for row in rows for pair in zip(row["page"], row["planner"], strict=True)]
        results = {"people": PEOPLE, "all": count(pairs), "levels": rows}
        options.out.write_text(json.dumps(results) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
