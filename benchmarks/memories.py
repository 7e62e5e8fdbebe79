"""Four memories of a pursuer with a lidar, learned by DAgger from `P_any` with one budget.

    python benchmarks/memories.py belief,sighting,gru,both 0,1,2 1000000 250 3.0

trains and judges networks, seeds, env steps, games, seconds of a sighting. Results go into benchmarks/out, a line each.
"""

import json
import sys
import time
from dataclasses import replace
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax

from apollonius.agents.kind import Named
from apollonius.agents.network import apply, apply_to_batch, widened
from apollonius.agents.policy import AbstractActionValuePolicy
from apollonius.agents.pool import Apart, solo
from apollonius.agents.searching import Searching
from apollonius.agents.shield import shielded
from apollonius.agents.trained import find_trained
from apollonius.arenas.charting import charted
from apollonius.arenas.file import find_game
from apollonius.catalogue import find_player, price_of_losing
from apollonius.evaluate.match import Match, play_match
from apollonius.game.by_side import BySide
from apollonius.game.game import reset_batch
from apollonius.game.sensing import Sensing
from apollonius.game.types import Role
from apollonius.observe import tracking
from apollonius.observe.believing import BELIEVING
from apollonius.observe.egocentric import EGOCENTRIC
from apollonius.observe.view import look
from apollonius.play.random_bits import random_bits
from apollonius.play.rollout import begin, reset_where_done, step_games

UNITS, GAMES, STEPS, BURN, KEPT, SEQUENCES, UPDATES = 96, 192, 40, 8, 24, 8, 72
INFORMED = float(sys.argv[5])
DEEPEST, ORDER, EPSILON = 0.3, 10.0, 0.05
ARMS = {"sighting": (False, False), "belief": (True, False), "gru": (False, True), "both": (True, True)}


class Student(AbstractActionValuePolicy):
    layers: tuple
    gru: eqx.nn.GRUCell | None
    mask: jax.Array
    epsilon: jax.Array | float = 0.0

    @property
    def observation(self):
        return BELIEVING

    @property
    def memory(self):
        return jnp.zeros(UNITS) if self.gru else ()

    def values(self, seen):
        raise NotImplementedError

    def weigh(self, seen, memory, bits):
        numbers = seen * self.mask
        if self.gru:
            memory = self.gru(numbers, memory)
            numbers = jnp.concatenate([numbers, memory])
        return apply(self.layers, numbers), memory

    def __call__(self, seen, memory, bits):
        values, memory = self.weigh(seen, memory, bits)
        strays = (bits >> 8).astype(jnp.float32) / 2**24 < self.epsilon
        return jnp.where(strays, (bits & 255) % 9, jnp.argmax(values)).astype(jnp.int32), memory


class Sr(Searching):
    def weigh(self, seen, memory, bits):
        own, own_memory = self.policy.weigh(self.policy.observation(seen), memory[0], bits)
        found = jnp.asarray(seen.opponent.age) < INFORMED
        shares = jax.random.uniform(jax.random.fold_in(jax.random.key(bits), 6), (1600,))
        s, place = self.search.look_on(seen, memory[1], shares)
        return jnp.where(found, own, s), (own_memory, jnp.where(found, -1, place))


def make_student(arm, scale, key):
    believes, remembers = ARMS[arm]
    network = widened(find_trained("P_any")[0].network, BELIEVING)
    layers = network.layers
    if remembers:
        first = layers[0]
        weight = jnp.pad(first.weight, ((0, 0), (0, UNITS)))
        wide = eqx.nn.Linear(BELIEVING.size + UNITS, first.out_features, key=key)
        layers = (eqx.tree_at(lambda layer: (layer.weight, layer.bias), wide, (weight, first.bias)), *layers[1:])
    last = layers[-1]
    last = eqx.tree_at(lambda layer: (layer.weight, layer.bias), last, (last.weight / scale, last.bias / scale))
    mask = jnp.where((jnp.arange(BELIEVING.size) < EGOCENTRIC.size + 2) | believes, 1.0, 0.0)
    gru = eqx.nn.GRUCell(BELIEVING.size, UNITS, key=key) if remembers else None
    return Student((*layers[:-1], last), gru, mask)


def train(arm, seed, steps, out):
    game = find_game_for("suite-v1/train")
    teacher = find_player("P_any", Role.PURSUER, game)
    scale = price_of_losing(teacher, game)
    informed = teacher.policy
    key = jax.random.fold_in(jax.random.key(seed), 7)
    student = make_student(arm, scale, key)
    optimizer = optax.adam(optax.linear_schedule(5e-4, 5e-5, UPDATES * (steps // (GAMES * STEPS))))
    params, static = eqx.partition(student, lambda leaf: eqx.is_array(leaf) and leaf.dtype == jnp.float32)
    params = eqx.tree_at(lambda p: p.mask, params, None, is_leaf=lambda x: x is None)
    static = eqx.tree_at(lambda s: s.mask, static, student.mask, is_leaf=lambda x: x is None)
    names = ["still", "still", "E_any", "E_any", "hide", "random"]
    evaders = [find_player(name, Role.EVADER, game).policy for name in names]
    shares = [GAMES // len(names)] * len(names)

    def players(params):
        plays = replace(eqx.combine(params, static), epsilon=EPSILON)
        return BySide(solo(plays), Apart(tuple(evaders), tuple(shares)))

    def label(known, state, place):
        view = look(game, known, Role.PURSUER)
        true = informed.weigh(
            informed.observation(look(game, replace(state, sight=None), Role.PURSUER)), (), jnp.uint32(0)
        )[0]
        lately = jnp.asarray(view.opponent.age) < INFORMED
        behind = jnp.max(true) - true
        value = -DEEPEST * behind / (behind + jnp.maximum(jnp.median(behind), 1e-6))
        return jnp.where(lately, value, 1.0), place

    def iterate(params, opt, games, places, buffer, number, key):
        bits_key, start_key, learn_key = jax.random.split(key, 3)
        starts = reset_batch(game, start_key, GAMES)
        both = players(params)
        first = games.sides.pursuer.memory

        def one(carry, t):
            games, places = carry
            bits = random_bits(jax.random.fold_in(bits_key, t), (4, GAMES))
            after, moved = step_games(game, both, games, bits[:2], observes=True)
            track = after.sides.pursuer.track
            known = jax.vmap(lambda tr, s: tracking.believed(game, tr, s, Role.PURSUER))(track, games.state)
            labels, places = jax.vmap(label)(known, games.state, places)
            fresh = begin(game, starts, both, bits[2:])
            over = moved.ended
            after = jax.vmap(reset_where_done)(over, fresh, after)
            return (after, jnp.where(over, -1, places)), (moved.sides.pursuer.observation, labels, over, moved.outcome)

        (games, places), (seen, labels, over, outcome) = jax.lax.scan(one, (games, places), jnp.arange(STEPS))
        swap = partial(jnp.swapaxes, axis1=0, axis2=1)
        memory = first[:, 0] if not isinstance(first, tuple) else jnp.zeros((GAMES, 0))
        new = swap(seen), swap(labels), swap(over), memory
        buffer = jax.tree.map(
            lambda rows, n: jax.lax.dynamic_update_slice_in_dim(rows, n, (number % KEPT) * GAMES, 0), buffer, new
        )
        filled = jnp.minimum(number + 1, KEPT) * GAMES

        def loss(params, rows):
            seen, labels, over, memory = rows
            model = eqx.combine(params, static)
            seen = seen * model.mask
            if model.gru:

                def remember(h, step):
                    x, was_over = step
                    h = jax.vmap(model.gru)(x, h)
                    return jnp.where(was_over[:, None], 0.0, h), h

                _, hs = jax.lax.scan(remember, memory, (swap(seen), swap(over)))
                seen = jnp.concatenate([seen, swap(hs)], axis=2)
            seen, labels = (x[:, BURN:].reshape(-1, x.shape[-1]) for x in (seen, labels))
            known = labels[:, :1] <= 0
            wrong = jnp.where(known, apply_to_batch(model.layers, seen) - labels, 0.0)
            mean = jnp.mean(wrong, axis=1)
            return ORDER * jnp.mean(jnp.sum((wrong - mean[:, None]) ** 2, axis=1)) + jnp.mean(mean**2)

        def update(carry, key):
            params, opt = carry
            rows = jax.random.randint(key, (SEQUENCES,), 0, filled)
            value, slope = eqx.filter_value_and_grad(loss)(params, jax.tree.map(lambda leaf: leaf[rows], buffer))
            change, opt = optimizer.update(slope, opt, params)
            return (eqx.apply_updates(params, change), opt), value

        (params, opt), losses = jax.lax.scan(update, (params, opt), jax.random.split(learn_key, UPDATES))
        return params, opt, games, places, buffer, jnp.mean(losses), jnp.bincount(outcome.ravel(), length=16)

    iterate = jax.jit(iterate, donate_argnums=(0, 1, 2, 3, 4))
    key = jax.random.key(seed)
    both = players(params)
    games = jax.jit(lambda k: begin(game, reset_batch(game, k, GAMES), both, random_bits(k, (2, GAMES))))(key)
    width = UNITS if student.gru else 0
    buffer = (
        jnp.zeros((KEPT * GAMES, STEPS, BELIEVING.size)),
        jnp.zeros((KEPT * GAMES, STEPS, 9)),
        jnp.zeros((KEPT * GAMES, STEPS), bool),
        jnp.zeros((KEPT * GAMES, width)),
    )
    opt, places = optimizer.init(params), jnp.full(GAMES, -1, jnp.int32)
    params = jax.tree.map(jnp.copy, params)
    counts, compiled = 0, None
    total = steps // (GAMES * STEPS)
    for number in range(total):
        params, opt, games, places, buffer, value, ends = iterate(
            params, opt, games, places, buffer, jnp.int32(number), jax.random.fold_in(key, number)
        )
        counts = counts + np.asarray(ends)
        if number == 0:
            compiled = time.time()
        if number % 10 == 9 or number == total - 1:
            print(
                arm,
                seed,
                (number + 1) * GAMES * STEPS,
                f"{float(value):.4f}",
                counts.tolist(),
                f"{time.time() - compiled:.0f} s",
                flush=True,
            )
            counts = 0
    wall = time.time() - compiled
    student = eqx.combine(params, static)
    eqx.tree_serialise_leaves(out / f"{arm}-{seed}.eqx", student)
    return student, wall


def find_game_for(scenario):
    game = find_game("lidar")
    rules = replace(find_game(scenario), sensors=Sensing(pursuer=game.sensors.pursuer))
    starts = replace(rules.starts, clearance=0.15) if scenario.endswith("train") else rules.starts
    return charted(replace(rules, starts=starts), True)


def judge(arm, seed, student, wall, games):
    game = find_game_for("suite-v1/held-out")
    rows = {}
    for evader in ("shielded:E_any",) if seed else ("shielded:E_any", "still"):
        policy = shielded(Sr(student, find_player("search", Role.PURSUER, game).policy), game, Role.PURSUER)
        found = find_player(evader, Role.EVADER, game)
        result = play_match(Match(game, BySide(Named(arm, policy), found), games))
        rows[evader] = result.outcomes
        print(arm, seed, evader, result.outcomes, flush=True)
    numbers = jnp.zeros((1, BELIEVING.size))
    one = jax.jit(lambda s, n, m: s(n, m, jnp.uint32(0)))
    memory = student.memory
    one(student, numbers[0], memory)
    begun = time.perf_counter()
    for _ in range(2000):
        jax.block_until_ready(one(student, numbers[0], memory))
    micro = (time.perf_counter() - begun) / 2000 * 1e6
    return {"arm": arm, "seed": seed, "wall_s": wall, "microseconds": micro, "outcomes": rows}


if __name__ == "__main__":
    arms, seeds, steps, games = (
        sys.argv[1].split(","),
        [int(s) for s in sys.argv[2].split(",")],
        int(sys.argv[3]),
        int(sys.argv[4]),
    )
    out = Path(__file__).parent / "out"
    out.mkdir(exist_ok=True)
    for seed in seeds:
        for arm in arms:
            student, wall = train(arm, seed, steps, out)
            row = judge(arm, seed, student, wall, games)
            with (out / "results.jsonl").open("a") as file:
                file.write(json.dumps(row) + "\n")
