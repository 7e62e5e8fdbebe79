"""A best response: actions drawn, advantages, what an update changes, and a run with several tasks."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.network import apply_to_batch, make_network
from apollonius.agents.store import load_agent
from apollonius.agents.trained import load_network
from apollonius.agents.wrappers.clearance_penalty import COST, action_penalties
from apollonius.arenas.file import find_game
from apollonius.game.presets import make_game
from apollonius.game.types import BySide, Role
from apollonius.io.errors import InvalidInput
from apollonius.learn import ppo
from apollonius.learn.algorithm import LearningSide
from apollonius.learn.config import RunConfig
from apollonius.learn.ppo import LearnBatch, PPOConfig, SamplingPolicy, advantages
from apollonius.learn.replay_buffer import Row
from apollonius.learn.response import ResponseConfig, Task, train_round, training_tasks
from apollonius.learn.run import TrainingRun, load_first_network, require_agents
from apollonius.observe.egocentric import BRAKING, EGOCENTRIC, ROOM
from apollonius.observe.registry import find_observation
from tests.learn.test_run import agents, assert_same_end, begin, metrics, stop_after

PPO = PPOConfig(
    observation="encoded", width=32, depth=1, games=32, steps=16, batch=128, epochs=3, critic_first=0, clip=0.1,
    learning_rate=3e-3, final_learning_rate=3e-3, gamma=0.9, trace=0.8, entropy=0.01,
)  # fmt: skip
STAGE = ResponseConfig(opponents=("still", "random"), env_steps=2048, evaluations=1, evaluation_games=8)
RUN = RunConfig(stages=(STAGE,), game=replace(make_game("paper"), max_steps=40), algorithm=PPO)
LONG = 10**9
"""Length of a stage in which step sizes hardly change."""
SIZE = find_observation("encoded").size


def random_row(key, **changes):
    """Transitions of 16 steps of 32 games, of which some end."""
    keys = jax.random.split(key, 5)
    ended = jax.random.randint(keys[3], (16, 32), 0, 12)
    row = Row(
        observation=jax.random.normal(keys[0], (16, 32, SIZE)),
        action=jax.random.randint(keys[1], (16, 32), 0, 9),
        reward=jax.random.normal(keys[2], (16, 32)),
        next_observation=jnp.zeros((16, 32, 0)),
        terminated=ended == 0,
        truncated=ended == 1,
        active=jnp.ones((16, 32), bool),
    )
    return replace(row, **changes)


@pytest.fixture(scope="module")
def learner():
    return PPO.init_learner(*jax.random.split(jax.random.key(1)))


@eqx.filter_jit
def update_learner(learner, row, algorithm=PPO, rounds=0):
    env_steps = jnp.int32((rounds + 1) * algorithm.env_steps_per_iteration)
    side, error = algorithm.learn(LearningSide(learner), row, LONG, env_steps, jax.random.key(2))
    return side.learner, error


def test_unknown_opponents_are_refused_in_every_task():
    known, unknown = (Task(RUN.game, ("still", name)) for name in ("random", "nobody"))
    replace(STAGE, tasks=(known,)).require_players(RUN.game)
    with pytest.raises(InvalidInput, match="'nobody'"):
        replace(STAGE, tasks=(known, unknown)).require_players(RUN.game)


def test_sampling_policy_draws_actions_by_softmax_of_their_values():
    network = make_network("encoded", 8, 1, jax.random.key(0))
    seen, bits = jnp.ones(SIZE), jax.random.bits(jax.random.key(1), (40_000,), jnp.uint32)
    player = SamplingPolicy(network, 0.0, 1.0, 1.0)
    drawn = jax.vmap(lambda bits: player(seen, player.memory, bits)[0])(bits)
    odds = np.exp(np.asarray(network(seen), float))
    np.testing.assert_allclose(np.bincount(drawn, minlength=9) / 40_000, odds / odds.sum(), atol=0.01)
    logarithms = player.log_probabilities(seen[None])[0]
    np.testing.assert_allclose(np.exp(logarithms), odds / odds.sum(), atol=1e-6)
    assert int(player(seen, jnp.uint32(1), jnp.uint32(0xFFFFFFFF))[0]) == 8


def test_held_random_numbers_keep_the_action_probabilities():
    player = SamplingPolicy(make_network("encoded", 8, 1, jax.random.key(0)), 0.0, 1.0, 5.0)
    bits = jax.random.bits(jax.random.key(1), (200, 500), jnp.uint32)

    def step(held, bits):
        drawn, held = jax.vmap(lambda held, bits: player(jnp.ones(SIZE), held, bits))(held, bits)
        return held, (drawn, held)

    drawn, held = (np.asarray(each) for each in jax.lax.scan(step, jnp.full(500, player.memory), bits)[1])
    assert 0.19 < (held[1:] != held[:-1]).mean() < 0.21
    odds = np.exp(np.asarray(player.log_probabilities(jnp.ones((1, SIZE)))[0]))
    np.testing.assert_allclose(np.bincount(drawn.ravel(), minlength=9) / drawn.size, odds, atol=0.01)
    assert (held[0] == bits[0]).all(), "a game begins with a number of its own"


def test_clearance_penalty_lowers_the_logits_of_unsafe_actions():
    """An action that lacks 2 cm costs six tenths of a lost game: here 3 in its logarithm."""
    network = make_network("egocentric", 8, 1, jax.random.key(0))
    room = jnp.full(9, 0.4).at[4].set(0.03 / ROOM)
    seen = jax.random.normal(jax.random.key(1), (EGOCENTRIC.size,)).at[BRAKING:].set(room)
    plain, careful = (SamplingPolicy(network, wanted, 5.0, 1.0) for wanted in (0.0, 0.05))
    differences = [each.penalise(network(seen), seen) for each in (plain, careful)]
    np.testing.assert_allclose(differences[0] - differences[1], 0.02 * COST * 5.0 * np.eye(9)[4], atol=1e-4)
    np.testing.assert_allclose(action_penalties(seen, 0.05, 5.0), differences[0] - differences[1], atol=1e-4)


def test_advantages_match_generalised_advantage_estimation():
    """By the sum over the steps that follow, each of one game alone."""
    row, values = random_row(jax.random.key(0)), np.asarray(jax.random.normal(jax.random.key(9), (16, 32)))
    found = np.asarray(advantages(PPO, row, jnp.asarray(values)))
    ended = np.asarray(row.terminated | row.truncated)
    for game in range(32):
        for first in (0, 5, 15):
            expected, weight = 0.0, 1.0
            for step in range(first, 16):
                goes_on = step < 15 and not ended[step, game]
                after = values[step + 1, game] if goes_on else values[step, game]
                after = 0.0 if row.terminated[step, game] else after
                expected += weight * (row.reward[step, game] + 0.9 * after - values[step, game])
                weight *= 0.9 * 0.8
                if ended[step, game]:
                    break
            np.testing.assert_allclose(found[first, game], expected, atol=1e-4)


def batch_of(key, **changes):
    keys = jax.random.split(key, 4)
    batch = LearnBatch(
        observation=jax.random.normal(keys[0], (64, SIZE)),
        action=jax.random.randint(keys[1], (64,), 0, 9),
        log_probability=-2.2 + 0.3 * jax.random.normal(keys[2], (64,)),
        advantage=2 + 3 * jax.random.normal(keys[3], (64,)),
        value=jnp.linspace(-1, 1, 64),
        active=jnp.arange(64) % 4 > 0,
    )
    return replace(batch, **changes)


def test_ppo_loss_matches_schulman_et_al_over_active_rows(learner):
    batch = batch_of(jax.random.key(3))
    found, error = ppo.clipped_loss((learner.network, learner.critic), PPO, batch, 0.0)
    values, some = np.asarray(learner.network.batch(batch.observation), float), np.asarray(batch.active)
    odds = np.exp(values) / np.exp(values).sum(axis=1, keepdims=True)
    ratio = odds[np.arange(64), batch.action] / np.exp(np.asarray(batch.log_probability, float))
    gained = np.asarray(batch.advantage, float)
    gained = (gained - gained[some].mean()) / gained[some].std()
    gains = np.minimum(ratio * gained, np.clip(ratio, 0.9, 1.1) * gained)[some].mean()
    entropy = -(odds * np.log(odds)).sum(axis=1)[some].mean()
    judged = np.asarray(apply_to_batch(learner.critic, batch.observation))[:, 0]
    expected = ((judged - np.asarray(batch.value)) ** 2)[some].mean()
    np.testing.assert_allclose(error, expected, rtol=1e-4)
    np.testing.assert_allclose(found, expected - gains - 0.01 * entropy, rtol=1e-4, atol=1e-5)


def test_batch_in_which_nobody_is_in_play_changes_nothing(learner):
    batch = batch_of(jax.random.key(3), active=jnp.zeros(64, bool))
    (loss, error), gradient = eqx.filter_value_and_grad(ppo.clipped_loss, has_aux=True)(
        (learner.network, learner.critic), PPO, batch, 0.0
    )
    assert float(loss) == float(error) == 0.0
    assert all(not np.any(leaf) for leaf in jax.tree.leaves(gradient))


def test_update_raises_the_rewarded_action_less_with_a_narrow_clip(learner):
    """Here action 3 ends a game well."""
    row = random_row(jax.random.key(4), terminated=jnp.ones((16, 32), bool))
    row = replace(row, reward=(row.action == 3).astype(jnp.float32))

    def share(learner):
        logarithms = PPO.sampler(learner.network, 0.0).log_probabilities(row.observation.reshape(-1, SIZE))
        return np.exp(np.asarray(logarithms))[:, 3]

    after, _ = update_learner(learner, row)
    assert np.mean(share(after) > share(learner)) > 0.99
    freely, _ = update_learner(learner, row, replace(PPO, clip=1.0))
    assert np.median(share(after)) < 0.9 * np.median(share(freely))
    assert int(after.updates) == 3 * 4
    for _ in range(30):
        after, error = update_learner(after, row)
    assert share(after).mean() > 2.5 * share(learner).mean()
    assert float(error) / 12 < 0.11, "the critic knows how often that pays, no more"


def test_critic_learns_first_and_inactive_robots_teach_nothing(learner):
    row, patient = random_row(jax.random.key(5)), replace(PPO, critic_first=2)
    waits, _ = update_learner(learner, row, patient, rounds=1)
    assert eqx.tree_equal(waits.network, learner.network)
    assert not eqx.tree_equal(waits.critic, learner.critic)
    assert not eqx.tree_equal(update_learner(learner, row, patient, rounds=2)[0].network, learner.network)
    active = jnp.arange(32) % 2 == 0
    halves = [
        replace(row, active=jnp.broadcast_to(active, (16, 32)), reward=jnp.where(active, row.reward, other))
        for other in (0.0, 5.0)
    ]
    one, other = (update_learner(learner, each)[0] for each in halves)
    assert eqx.tree_equal(one.network, other.network)


def test_games_restart_from_states_of_lost_games():
    """A pursuer that stands marks its game: it is where it was at the start."""
    config, algorithm = replace(STAGE, opponents=("still",), restart_fraction=1.0), replace(PPO, steps=128)
    response = config.make(algorithm, replace(RUN.game, max_steps=1000))
    state = response.init(jax.random.key(1))
    begun = np.asarray(state.games[0].games.state.evader.x)
    (task,) = response.tasks
    after, _ = train_round(config, algorithm, replace(state, games=state.games[0]), task)
    ring = after.games.lost_states
    lost = jax.tree.map(lambda leaf: np.asarray(leaf)[: int(ring.filled)], ring.rows)
    assert 0 < len(lost.steps) < 32
    assert np.isin(lost.evader.x, begun).all(), "as they were before the round"
    under_way = np.asarray(after.games.games.state.steps)
    again, _ = train_round(config, algorithm, after, task)
    games = again.games.games.state
    new = np.asarray(games.steps) != under_way + 128
    assert new.any()
    assert np.isin(np.asarray(games.pursuer.x)[new], lost.pursuer.x).all()


@pytest.mark.parametrize(("profile", "unit"), [("paper", 8.0), ("zero-sum", 1.0)])
def test_rewards_count_in_units_of_a_capture(profile, unit):
    reward = replace(RUN.game.reward, profile=profile, capture=8.0)
    assert float(PPO.reward_unit(replace(RUN.game, reward=reward))) == unit


def test_magnet_costs_its_divergence_over_active_rows(learner):
    """Kullback and Leibler's, from the policy to the magnet."""
    batch, pulled = batch_of(jax.random.key(3)), replace(PPO, magnet=0.3)
    networks = learner.network, learner.critic
    magnet = jax.nn.log_softmax(jax.random.normal(jax.random.key(4), (64, 9)))
    plain, _ = ppo.clipped_loss(networks, pulled, batch, 0.0)
    found, _ = ppo.clipped_loss(networks, pulled, replace(batch, log_magnet=magnet), 0.0)
    values, some = np.asarray(learner.network.batch(batch.observation), float), np.asarray(batch.active)
    odds = np.exp(values) / np.exp(values).sum(axis=1, keepdims=True)
    divergence = (odds * (np.log(odds) - np.asarray(magnet, float))).sum(axis=1)[some].mean()
    np.testing.assert_allclose(found - plain, 0.3 * divergence, rtol=1e-4)


def test_magnet_is_renewed_when_its_rounds_are_over(learner):
    pulled = replace(PPO, magnet=0.1, magnet_rounds=2)
    first = pulled.init_learner(*jax.random.split(jax.random.key(1)))
    row = random_row(jax.random.key(7))
    one, _ = update_learner(first, row, pulled)
    assert eqx.tree_equal(one.magnet, first.network)
    assert not eqx.tree_equal(one.network, first.network)
    two, _ = update_learner(one, row, pulled)
    assert eqx.tree_equal(two.magnet, two.network)
    three, _ = update_learner(two, row, pulled)
    assert eqx.tree_equal(three.magnet, two.network)
    never, _ = update_learner(two, row, replace(pulled, magnet_rounds=2**31 - 1))
    assert eqx.tree_equal(never.magnet, two.magnet)
    assert learner.magnet is None


def test_strong_magnet_holds_the_policy(learner):
    row = random_row(jax.random.key(4), terminated=jnp.ones((16, 32), bool))
    row = replace(row, reward=(row.action == 3).astype(jnp.float32))

    def share(algorithm):
        after = algorithm.init_learner(*jax.random.split(jax.random.key(1)))
        for _ in range(10):
            after, _ = update_learner(after, row, algorithm)
        values = after.network.batch(row.observation.reshape(-1, SIZE))
        return float(jnp.mean(jax.nn.softmax(values)[:, 3]))

    freely, held = share(PPO), share(replace(PPO, magnet=10.0, magnet_rounds=1000))
    assert held < 0.5 * freely


def test_initial_values_of_a_response_become_logits():
    """A lost game costs 10 in the values of `E_scratch`, and at a temperature of 0.1 of one 10 in its logits."""
    wide = replace(PPO, width=256, depth=4, temperature=0.1)
    given = replace(RUN, evader="E_scratch", algorithm=wide)
    first, agent = load_first_network(given, Role.EVADER), load_network("E_scratch", Role.EVADER)
    seen = jax.random.normal(jax.random.key(0), (5, SIZE))
    np.testing.assert_allclose(first.batch(seen), agent.batch(seen), rtol=1e-5)
    colder = load_first_network(replace(given, algorithm=replace(wide, temperature=0.01)), Role.EVADER)
    np.testing.assert_allclose(colder.batch(seen), 10 * agent.batch(seen), rtol=1e-5)


TEAMS = replace(
    RUN,
    game=replace(find_game("team-2v1"), max_steps=30),
    algorithm=replace(PPO, observation="team", games=8, steps=16, batch=32, hold=4.0),
    stages=(
        replace(
            STAGE,
            role="pursuer",
            env_steps=512,
            clearance_margin=0.05,
            restart_fraction=0.5,
            tasks=(Task(replace(make_game("paper"), max_steps=30)),),
        ),
    ),
)


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    folder = begin(tmp_path_factory.mktemp("response") / "run", TEAMS)
    assert TrainingRun(TEAMS, folder).execute()
    return folder


@pytest.mark.slow
def test_response_run_in_teams_and_alone_saves_one_agent(uninterrupted):
    assert list(agents(uninterrupted)) == ["P_response"]
    header = load_agent(uninterrupted / "agents" / "P_response.safetensors").header
    assert (header.clearance_margin, header.loss_value) == (0.05, 1 / TEAMS.algorithm.temperature)
    lines = metrics(uninterrupted)
    assert [line["env_steps"] for line in lines] == [128, 256, 384, 512]
    assert sum(lines[-1]["evaluation"]["outcomes"].values()) == 8


@pytest.mark.slow
def test_stopped_response_resumes_to_the_same_end(uninterrupted, tmp_path):
    folder = begin(tmp_path / "run", TEAMS)
    assert not TrainingRun(TEAMS, folder, should_stop=stop_after(2)).execute()
    assert TrainingRun(TEAMS, folder).execute()
    assert_same_end(folder, uninterrupted)


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_agent_keeps_the_configured_share_of_its_initial_weights(share):
    first, later = (make_network("encoded", 32, 1, jax.random.key(seed)) for seed in (3, 4))
    response = replace(STAGE, initial_weight_share=share).make(PPO, RUN.game)
    state = response.init(jax.random.key(0), BySide(None, first))
    moved = eqx.tree_at(lambda state: state.learners[Role.EVADER].learner.network, state, later)
    agent = response.agents(moved)[Role.EVADER]
    weights = (network.layers[0].weight for network in (agent, first, later))
    own, before, after = weights
    np.testing.assert_allclose(own, share * before + (1 - share) * after, atol=1e-6)


def test_training_tasks_have_their_own_games_and_opponents():
    tasks = Task(make_game("paper")), Task(find_game("office"), opponents=("flee", "still"))
    tasks_ = training_tasks(replace(STAGE, role="pursuer", tasks=tasks), PPO, RUN.game)
    kinds = [[type(one).__name__ for one in task.opponents] for task in tasks_]
    assert kinds == [["Still", "Uniform"], ["Still", "Uniform"], ["Flee", "Still"]]
    assert tasks_[2].game.arena.x_max > tasks_[1].game.arena.x_max == tasks_[0].game.arena.x_max


def test_evaluations_keep_the_rules_of_the_run():
    stage = replace(STAGE, time_limit=20, failure=3.0).make(PPO, RUN.game)
    assert (stage.tasks[0].game.max_steps, stage.tasks[0].game.reward.failure) == (20, 3.0)
    assert (stage.evaluation_game.max_steps, stage.evaluation_game.reward) == (40, RUN.game.reward)


def test_tasks_in_which_a_response_cannot_learn_are_refused():
    team = find_game("team-2v1")
    zero_sum = replace(team, reward=replace(team.reward, profile="zero-sum"))
    with pytest.raises(InvalidInput, match=r"reward.profile = zero-sum .*'paper'"):
        replace(RUN, stages=(replace(STAGE, role="pursuer", tasks=(Task(zero_sum),)),))


@pytest.mark.parametrize(
    "change", [{"opponents": ("table", "still")}, {"tasks": (Task(RUN.game, ("still", "table")),)}]
)
def test_response_to_a_solved_game_is_refused(change):
    with pytest.raises(InvalidInput, match=r"opponents = table .*no solved game"):
        replace(STAGE, **change)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"algorithm": replace(PPO, games=1, batch=16)}, "games = 1 .*as many at least as opponents"),
        ({"stages": (replace(STAGE, opponents=("nobody", "still")),)}, "unknown agent 'nobody'"),
        ({"stages": (replace(STAGE, clearance_margin=0.05),)}, "know the room to brake"),
    ],
)
def test_impossible_responses_are_refused(change, message):
    with pytest.raises(InvalidInput, match=message):
        require_agents(replace(RUN, **change))


def test_batch_must_divide_the_transitions_of_a_round():
    with pytest.raises(InvalidInput, match=r"batch = 100 .* games x steps = 512"):
        replace(PPO, batch=100)
