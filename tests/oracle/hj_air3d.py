"""The same two cars by hj-reachability, where that is installed: its `Air3d` on its finest scheme."""

import jax
import numpy as np


def least_distance(cars, size, places, headings, seconds):
    """As `numpy_air3d.least_distance`, by the Hamilton-Jacobi equation in continuous time."""
    import hj_reachability as hj

    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        box = hj.sets.Box(np.array([-size, -size, 0.0]), np.array([size, size, 2 * np.pi]))
        grid = hj.Grid.from_lattice_parameters_and_boundary_conditions(box, (places, places, headings), periodic_dims=2)
        air3d = hj.systems.Air3d(cars.evader, cars.pursuer, cars.turn, cars.turn)
        settings = hj.SolverSettings.with_accuracy(
            "very_high", hamiltonian_postprocessor=hj.solver.backwards_reachable_tube
        )
        beyond = np.hypot(grid.states[..., 0], grid.states[..., 1]) - cars.capture
        values = hj.step(settings, air3d, grid, 0.0, beyond, -seconds, progress_bar=False)
    return np.asarray(values).transpose(2, 0, 1)
