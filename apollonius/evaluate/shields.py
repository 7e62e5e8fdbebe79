"""Shields of robots that differ, made alike: what is compiled for one of them serves all."""

from collections.abc import Sequence
from dataclasses import replace

import jax.numpy as jnp

from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.shield import Backup, Shielded
from apollonius.game.nearby import Surroundings


def alike(policies: Sequence[AbstractPolicy]) -> list[AbstractPolicy]:
    """The same players, whose shields all brake for as many steps and look at as many edges as any of them needs.

    No shield decides otherwise: a robot that has come to rest stays there, and the edges that are added are far from
    everywhere. Players without a shield are left as they are.

    Args:
        policies: of one side, in games of one arena; all of them behind shields, or none.
    """
    backups = [policy.backup for policy in policies if isinstance(policy, Shielded)]
    if not backups:
        return list(policies)
    steps = max(backup.steps for backup in backups)
    edges = max(one.within.shape[-1] if (one := backup.surroundings) else 0 for backup in backups)
    return [
        replace(policy, backup=_enlarged(policy.backup, steps, edges)) if isinstance(policy, Shielded) else policy
        for policy in policies
    ]


def _enlarged(backup: Backup, steps: int, edges: int) -> Backup:
    """Manoeuvres of so many steps, among so many edges."""
    around = backup.surroundings
    return replace(backup, steps=steps, surroundings=around and _padded(around, edges))


def _padded(around: Surroundings, edges: int) -> Surroundings:
    """The same surroundings, in each cell filled up with the last edge, which is far from everywhere."""
    missing = edges - around.within.shape[-1]
    far = around.edges.inverse.shape[0] - 1
    return replace(around, within=jnp.pad(around.within, ((0, 0), (0, 0), (0, missing)), constant_values=far))
