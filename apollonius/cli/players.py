"""`apollonius players`: who can play, and how players are named in the other commands."""

import argparse

from apollonius.agents.names import BUILT_IN, SIDES, side_of, zoo_names
from apollonius.cli.options import add_json, answer

ZOO = {
    "pursuer": "learned from four teachers in 416 arenas, plays in any, alone or in a team",
    "P_optimal": "learned from P_hunter, hard to exploit", "P_hunter": "learned from five evaders",
    "P_prioritised": "learned from its earlier selves", "P_pool": "learned from three evaders",
    "P_robust": "learned with slow, noisy robots", "P_smooth": "steers without steps",
    "P_curriculum": "of the paper: self-play after P_stage1", "P_scratch": "of the paper: self-play alone",
    "P_random": "of the paper: learned from a random evader", "P_stage1": "of the paper: standing targets only",
    "E_any": "learned from 15 solved games, plays in any arena", "E_optimal": "learned from the solved game",
    "E_prioritised": "learned from its earlier selves", "E_robust": "learned with slow, noisy robots",
    "E_smooth": "steers without steps", "E_curriculum": "of the paper: self-play after P_stage1",
    "E_scratch": "of the paper: self-play alone",
}  # fmt: skip
"""Agents that ship with the package, in a few words."""
OTHERS = {
    "RUN/NAME": "an agent of a training run, by the run's folder or its name among runs",
    "FILE.safetensors": "an agent's file, or a game that solve solved",
    "shielded:NAME": "any of these behind a shield: it never crashes, by the rules, where it starts at rest",
    "searching:NAME": "a pursuer of limited sight that searches while it does not see the evader; after shielded:",
}


def add_players(parser: argparse.ArgumentParser) -> None:
    add_json(parser)
    parser.set_defaults(run=run_players, compiles=False)


def run_players(options: argparse.Namespace) -> int:
    words = {name: about for name, (_, about) in BUILT_IN.items()} | {name: ZOO.get(name, "") for name in zoo_names()}
    lines = []
    for sides in (SIDES[:1], SIDES[1:], SIDES):
        lines += [f"{' or '.join(sides)}:", *_rows({name: words[name] for name in words if side_of(name) == sides})]
    lines += ["your own:", *_rows(OTHERS), "more about each: docs/reference/agents.md"]
    facts = [{"name": name, "sides": side_of(name), "about": about} for name, about in words.items()]
    answer(options, {"players": facts, "forms": OTHERS}, "\n".join(lines))
    return 0


def _rows(players: dict[str, str]) -> list[str]:
    return [f"  {name:<18}{about}" for name, about in players.items()]
