"""Settings on which the paper is silent: what its own tables say about them.

    python benchmarks/silent_settings.py draw FILE --draws 0-59
    python benchmarks/silent_settings.py judge FILE --out FOLDER

`draw` trains all of the paper's agents once for each draw of the settings from their prior, with a
short training of the profile `fast`, and plays the matches of Tables II and III; some four minutes
of a core each. A draw is done by its number: a second call does those that are missing.

`judge` fits how outcomes depend on settings, and keeps the settings from which the paper's tables
could come: their posterior, by rejection.
"""

import argparse
import json
import math
import tempfile
from dataclasses import asdict, astuple, dataclass, fields, replace
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jaxtyping import Bool, Float

from apollonius import Disc, Match, make_game
from apollonius.evaluate.claims import STAGE_1, TABLE_2, TABLE_3
from apollonius.evaluate.match import count_results, play_games
from apollonius.game.game import Game
from apollonius.io.document import write_atomically
from apollonius.learn.config import PRESETS, RunConfig
from apollonius.learn.folder import agent_file, create_run
from apollonius.learn.run import train
from apollonius.reproduce.study import RUN_OF, run_configs
from apollonius.show import palette, style

ENV_STEPS = 4_000_000
"""Length of each stage."""
GAMES = 2000
"""Games of a match; those of the paper have 500."""
MATCHES = {
    "P_stage1 v still": ("P_stage1", "still"),
    "P_random v random": ("P_random", "random"),
    "P_curriculum v random": ("P_curriculum", "random"),
    "P_random v E_scratch": ("P_random", "E_scratch"),
    "P_curriculum v E_scratch": ("P_curriculum", "E_scratch"),
    "P_scratch v E_curriculum": ("P_scratch", "E_curriculum"),
}


@dataclass(frozen=True)
class Settings:
    """What the paper does not print."""

    dt: float
    """Time step [s]."""
    discs: int
    """Number of circular obstacles."""
    radius: float
    """Their radius [m]."""
    moving_in_training: bool
    """True if robots start with any speed in training, False if at rest."""
    moving_in_tests: bool
    """The same of the matches of the tables."""
    progress: float
    """Weight c of Eq. 8 and 9 [1/m], in all stages."""
    target_period: int
    """Env steps between two copies of the target network (C of both algorithms)."""
    final_epsilon: float
    """Share of random actions once exploration has settled."""
    limit_ends: bool
    """True if no value is bootstrapped from the last state of a game without result."""


def draw_settings(random: np.random.Generator) -> Settings:
    """Draw settings from their prior."""

    def log_uniform(low: float, high: float) -> float:
        return math.exp(random.uniform(math.log(low), math.log(high)))

    return Settings(
        dt=round(log_uniform(0.05, 0.3), 3),
        discs=int(random.integers(1, 6)),
        radius=round(random.uniform(0.2, 0.8), 2),
        moving_in_training=bool(random.integers(2)),
        moving_in_tests=bool(random.integers(2)),
        progress=round(log_uniform(0.3, 10.0), 2),
        target_period=round(log_uniform(16_000, 512_000)),
        final_epsilon=round(log_uniform(0.01, 0.2), 3),
        limit_ends=bool(random.integers(2)),
    )


def place_discs(settings: Settings, random: np.random.Generator) -> tuple[Disc, ...]:
    """Draw the places of the discs: 1 m or more between each and the next, and the walls."""
    room, radius = make_game("paper").arena, settings.radius
    least = radius + 1.0
    low = float(room.x_min) + least, float(room.y_min) + least
    high = float(room.x_max) - least, float(room.y_max) - least
    while True:
        places = random.uniform(low, high, (settings.discs, 2))
        distances = np.linalg.norm(places[:, None] - places[None], axis=-1)
        apart = distances[~np.eye(settings.discs, dtype=bool)]
        if np.all(apart >= 2 * radius + 1.0):
            return tuple(Disc(float(x), float(y), radius) for x, y in places)


def game_of(settings: Settings, discs: tuple[Disc, ...], moving: bool) -> Game:
    """Return the game of some settings, with starts at rest or not."""
    game = make_game("paper")
    arena = replace(game.arena, discs=discs)
    starts = replace(game.starts, speed="moving" if moving else "rest")
    return replace(game, arena=arena, starts=starts, dt=settings.dt)


def config_of(settings: Settings, game: Game, seed: int) -> RunConfig:
    """Return the training by which the agents of a draw learn."""
    quick = PRESETS["quick"]
    algorithm = replace(
        quick.algorithm, target_period=settings.target_period, final_epsilon=settings.final_epsilon
    )
    stages = tuple(
        replace(
            stage,
            env_steps=ENV_STEPS,
            progress=settings.progress,
            limit_terminates=settings.limit_ends,
            evaluations=4,
        )
        for stage in quick.stages
    )
    return replace(quick, seed=seed, game=game, algorithm=algorithm, stages=stages)


def run_draw(number: int, folder: Path) -> dict[str, Any]:
    """Train and judge the agents of a draw; return its settings, places and outcomes."""
    random = np.random.default_rng(number)
    settings = draw_settings(random)
    discs = place_discs(settings, random)
    config = config_of(settings, game_of(settings, discs, settings.moving_in_training), number)
    for name, training in run_configs(config, number).items():
        create_run(training, folder / name)
        train(folder / name)
    game = game_of(settings, discs, settings.moving_in_tests)

    def player(name: str) -> str:
        return str(agent_file(folder / RUN_OF[name], name)) if name in RUN_OF else name

    outcomes: dict[str, dict[str, int]] = {}
    for name, players in MATCHES.items():
        match = Match.of_names(game, *map(player, players), games=GAMES, seed=number)
        outcomes[name] = count_results(match, play_games(match)).outcomes
    places = [[round(disc.x, 2), round(disc.y, 2)] for disc in discs]
    return {"draw": number} | asdict(settings) | {"places": places, "outcomes": outcomes}


def numbers_of(text: str) -> range:
    """Read a range of draws, as 0-29."""
    first, _, last = text.partition("-")
    return range(int(first), int(last or first) + 1)


def draw(file: Path, numbers: range) -> None:
    """Run the draws that a file lacks, and write each into it."""
    rows = read_rows(file) if file.is_file() else []
    done = {row["draw"] for row in rows}
    for number in numbers:
        if number in done:
            continue
        with tempfile.TemporaryDirectory() as folder:
            rows.append(run_draw(number, Path(folder)))
        print(json.dumps(rows[-1]), flush=True)
        write_rows(file, rows)
        jax.clear_caches()  # programs of a draw are of no use to the next one, and fill the memory


def read_rows(file: Path) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = json.loads(file.read_text(encoding="utf-8"))["draws"]
    return rows


def write_rows(file: Path, rows: list[dict[str, Any]]) -> None:
    """Write the draws, one a line."""
    lines = ",\n  ".join(json.dumps(row) for row in sorted(rows, key=lambda row: row["draw"]))
    head = f'"env steps of a stage": {ENV_STEPS}, "games of a match": {GAMES}'
    text = f'{{\n {head},\n "draws": [\n  {lines}\n ]\n}}\n'
    write_atomically(file, text.encode())


OUTCOMES = tuple(TABLE_2["P_random"])
TABLES = {
    "P_random v random": TABLE_2["P_random"],
    "P_curriculum v random": TABLE_2["P_curriculum"],
    "P_random v E_scratch": TABLE_3["P_random"],
    "P_curriculum v E_scratch": TABLE_3["P_curriculum"],
}
"""The paper's 24 counts by match."""
PAPER_GAMES = 500
UNDEFEATED = 0.70
"""Share of the games with `P_scratch` that `E_curriculum` does not lose, in the paper (Fig. 6)."""
SIMULATIONS, ACCEPTED = 100_000, 500
"""Tables that are simulated, and how many are accepted: the nearest to the paper's."""
OURS = Settings(0.1, 3, 0.5, False, False, 3.0, 128_000, 0.02, False)
"""The choices of the profile `fast`; its c is 3 in stage 1 and 1 in self-play."""


def features(settings: Settings) -> list[float]:
    """Return numbers that logarithms of shares are linear in: one for each setting, from -1 to 1
    over its prior; the square of the time step's, and the area that discs take.
    """
    dt = math.log(settings.dt / 0.122) / 0.9
    discs, radius = (settings.discs - 3) / 2, (settings.radius - 0.5) / 0.3
    learning = [
        math.log(settings.progress / 1.73) / 1.75,
        math.log(settings.target_period / 90_500) / 1.73,
        math.log(settings.final_epsilon / 0.0447) / 1.5,
    ]
    flags = settings.moving_in_training, settings.moving_in_tests, settings.limit_ends
    return [
        1.0,
        dt,
        dt**2,
        discs,
        radius,
        discs * radius,
        *learning,
        *(2.0 * flag - 1 for flag in flags),
    ]


def summary(tables: list[dict[str, int]], captured: float, undefeated: float) -> list[float]:
    """Return the logarithms of all shares of four tables about their means, and of the odds of two
    rates; half a game is added to each outcome.
    """
    numbers: list[float] = []
    for table in tables:
        counts = np.array([table[outcome] for outcome in OUTCOMES], float)
        logarithms = np.log((counts * PAPER_GAMES / counts.sum()) + 0.5)
        numbers += list(logarithms - logarithms.mean())
    return numbers + [math.log((rate + 0.001) / (1.001 - rate)) for rate in (captured, undefeated)]


def summary_of_draw(row: dict[str, Any]) -> list[float]:
    outcomes = row["outcomes"]
    still, fleeing = outcomes["P_stage1 v still"], outcomes["P_scratch v E_curriculum"]
    won = ("captured", "evader_hit_obstacle", "evader_out_of_range")
    captured = still["captured"] / GAMES
    undefeated = 1 - sum(fleeing[outcome] for outcome in won) / GAMES
    return summary([outcomes[name] for name in TABLES], captured, undefeated)


PAPER = summary(list(TABLES.values()), STAGE_1, UNDEFEATED)


@dataclass(frozen=True)
class Emulator:
    """Outcomes as a linear function of settings, with what the draws leave unexplained.

    That is the spread between trainings, and what is not linear.
    """

    weights: Float[np.ndarray, "features numbers"]
    residuals: Float[np.ndarray, "draws numbers"]
    """Of each draw, from a fit without it."""

    @classmethod
    def fit(
        cls, x: Float[np.ndarray, "draws features"], y: Float[np.ndarray, "draws numbers"]
    ) -> "Emulator":
        """Fit by ridge regression; one unit of the penalty is one more draw at the means."""
        penalty = np.eye(x.shape[1])
        penalty[0, 0] = 0.0
        inverse = np.linalg.inv(x.T @ x + penalty)
        leverage = np.einsum("df,fg,dg->d", x, inverse, x)
        weights = inverse @ x.T @ y
        return cls(weights, (y - x @ weights) / (1 - leverage)[:, None])

    def simulate(
        self, x: Float[np.ndarray, "simulations features"], random: np.random.Generator
    ) -> Float[np.ndarray, "simulations numbers"]:
        """Return the outcomes of one training each in 500 games."""
        errors = self.residuals[random.integers(len(self.residuals), size=len(x))]
        y = x @ self.weights + errors
        for first in range(0, len(OUTCOMES) * len(TABLES), len(OUTCOMES)):
            part = slice(first, first + len(OUTCOMES))
            shares = np.exp(y[:, part])
            shares /= shares.sum(axis=1, keepdims=True)
            logarithms = np.log(random.multinomial(PAPER_GAMES, shares) + 0.5)
            y[:, part] = logarithms - logarithms.mean(axis=1, keepdims=True)
        return y


def nearest(
    simulated: Float[np.ndarray, "simulations numbers"], target: Float[np.ndarray, " numbers"]
) -> Bool[np.ndarray, " simulations"]:
    """Choose the simulations that are nearest to a target, in standard deviations."""
    distances = np.sum(((simulated - target) / simulated.std(axis=0)) ** 2, axis=1)
    return distances <= np.partition(distances, ACCEPTED)[ACCEPTED]


def describe(
    prior: Float[np.ndarray, " many"], accepted: Float[np.ndarray, " few"], ours: float
) -> dict[str, Any]:
    """Return quantiles of a posterior, and the places in the prior of these and of our choice."""
    points = np.quantile(accepted, [0.05, 0.25, 0.5, 0.75, 0.95])
    return {
        "quantiles": points.tolist(),
        "in the prior": [place_in(prior, point) for point in points],
        "mean": float(accepted.mean()),
        "ours in the prior": place_in(prior, ours),
    }


def place_in(prior: Float[np.ndarray, " many"], value: float) -> float:
    """Return the share of a prior that is below a value, with half of what equals it."""
    return float(np.mean(prior < value) + np.mean(prior == value) / 2)


def counts_within(simulated: Float[np.ndarray, "simulations numbers"]) -> int:
    """Count the numbers of the paper's tables within the central 95 % of simulations."""
    low, high = np.quantile(simulated, [0.025, 0.975], axis=0)
    inside = (low <= np.array(PAPER)) & (np.array(PAPER) <= high)
    return int(inside[: len(OUTCOMES) * len(TABLES)].sum())


def explained(y: Float[np.ndarray, "draws numbers"], emulator: Emulator) -> float:
    """Return the share of the variance between draws that settings explain, of those left out."""
    return float(1 - emulator.residuals.var() / (y - y.mean(axis=0)).var())


def coverage(
    x: Float[np.ndarray, "draws features"],
    y: Float[np.ndarray, "draws numbers"],
    own_settings: Float[np.ndarray, "draws settings"],
    prior_x: Float[np.ndarray, "simulations features"],
    prior: Float[np.ndarray, "simulations settings"],
) -> Float[np.ndarray, " settings"]:
    """Return the share of draws whose settings lie within the 90 % intervals that their own
    outcomes give, by a fit to the other draws.
    """
    random = np.random.default_rng(1)
    inside: list[Bool[np.ndarray, " settings"]] = []
    for number in range(len(x)):
        rest = np.arange(len(x)) != number
        simulated = Emulator.fit(x[rest], y[rest]).simulate(prior_x, random)
        accepted = prior[nearest(simulated, y[number])]
        low, high = np.quantile(accepted, [0.05, 0.95], axis=0)
        inside.append((low <= own_settings[number]) & (own_settings[number] <= high))
    return np.mean(inside, axis=0)


def judge(file: Path, out: Path) -> None:
    """Write the posterior of the settings, what it predicts, and a figure."""
    rows = read_rows(file)
    names = [field.name for field in fields(Settings)]
    drawn = [Settings(**{name: row[name] for name in names}) for row in rows]
    x = np.array([features(settings) for settings in drawn])
    y = np.array([summary_of_draw(row) for row in rows])
    random = np.random.default_rng(0)
    simulated_settings = [draw_settings(random) for _ in range(SIMULATIONS)]
    prior_x = np.array([features(settings) for settings in simulated_settings])
    prior = np.array([astuple(settings) for settings in simulated_settings], float)
    emulator = Emulator.fit(x, y)
    simulated = emulator.simulate(prior_x, random)
    accepted = nearest(simulated, np.array(PAPER))
    few = slice(SIMULATIONS // 10)
    drawn_values = np.array([astuple(settings) for settings in drawn], float)
    inside = coverage(x, y, drawn_values, prior_x[few], prior[few])
    columns = dict(zip(names, prior.T, strict=True))
    ours = asdict(OURS)
    posterior = {
        name: describe(column, column[accepted], ours[name]) for name, column in columns.items()
    }
    result = {
        "draws": len(rows),
        "simulations": SIMULATIONS,
        "accepted": int(accepted.sum()),
        "posterior": posterior,
        "counts of the paper within 95 %": {
            "of the prior": counts_within(simulated),
            "of the posterior": counts_within(simulated[accepted]),
        },
        "variance that settings explain": explained(y, emulator),
        "draws within 90 % intervals from their own outcomes": dict(
            zip(names, inside.tolist(), strict=True)
        ),
    }
    text = json.dumps(result, indent=1)
    write_atomically(out / "silent_settings_posterior.json", f"{text}\n".encode())
    draw_posterior(posterior, out / "silent_settings.png")
    print(text)


LABELS = {
    "dt": "time step",
    "discs": "number of discs",
    "radius": "radius of discs",
    "progress": "weight c",
    "target_period": "target copy C",
    "final_epsilon": "exploration ends at",
    "moving_in_training": "moving starts in training",
    "moving_in_tests": "moving starts in tests",
    "limit_ends": "time limit is an end",
}


def draw_posterior(posterior: dict[str, dict[str, Any]], path: Path) -> None:
    """Draw a row for each setting, from the least to the greatest value of its prior."""
    with style.picture(path, width=6.4, height=3.6) as (axes,):
        for row, name in enumerate(LABELS):
            described = posterior[name]
            ours = described["ours in the prior"]
            if isinstance(getattr(OURS, name), bool):
                ours = float(getattr(OURS, name))
                axes.plot(described["mean"], row, "o", color=palette.PURSUER)
                axes.text(1.02, row, f"{described['mean']:.0%} say yes", va="center")
            else:
                low, quarter, median, three_quarters, high = described["in the prior"]
                axes.plot([low, high], [row, row], color=palette.PURSUER, linewidth=1.5)
                axes.plot([quarter, three_quarters], [row, row], color=palette.PURSUER, linewidth=5)
                axes.plot(median, row, "o", color=palette.PAPER, markersize=3)
                ends = described["quantiles"]
                axes.text(1.02, row, f"{ends[0]:.3g} to {ends[4]:.3g}", va="center")
            axes.plot(ours, row, "D", color=palette.INK, markersize=4)
        axes.set_yticks(range(len(LABELS)), LABELS.values())
        axes.set(xlim=(0, 1), xlabel="place in the prior", ylim=(len(LABELS) - 0.5, -0.5))
        axes.set_title("What the paper's tables say of each setting (diamonds: ours)")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    drawing = commands.add_parser("draw", help="train and play")
    drawing.add_argument("file", type=Path)
    drawing.add_argument("--draws", type=numbers_of, default=range(60), help="as 0-29")
    judging = commands.add_parser("judge", help="find the posterior")
    judging.add_argument("file", type=Path)
    judging.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    if options.command == "draw":
        draw(options.file, options.draws)
    else:
        judge(options.file, options.out)


if __name__ == "__main__":
    main()
