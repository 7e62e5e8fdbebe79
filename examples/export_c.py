"""Write a function of your own as C, and call it: a controller that needs neither Python nor JAX.

    python examples/export_c.py

It writes chase.c and chase.h, and prints what C and JAX compute; without gcc it says so:

    chase.h: 20 lines
    chase.c: 31 lines
    JAX: 0.2714 m/s^2, 0.8000 rad/s
    C:   0.2714 m/s^2, 0.8000 rad/s
"""

import ctypes
import shutil
import subprocess
from pathlib import Path

import jax.numpy as jnp

import jaxpr2c


def chase(robot, target):
    """Return the acceleration [m/s^2] and turn rate [rad/s] that bring a robot to a target.

    The robot is x [m], y [m], speed [m/s] and heading [rad], the target x and y [m].
    """
    error = jnp.arctan2(target[1] - robot[1], target[0] - robot[0]) - robot[3]
    error = jnp.arctan2(jnp.sin(error), jnp.cos(error))
    return {"acceleration": 0.3 * jnp.cos(error), "turn_rate": jnp.clip(2 * error, -0.8, 0.8)}


def main() -> None:
    """Translate the function, compile it and call it."""
    robot = jnp.array([2.0, 3.0, 0.5, 0.1])
    target = jnp.array([7.0, 6.0])
    in_jax = chase(robot, target)

    program = jaxpr2c.translate(chase, robot, target, name="chase")
    for name, text in program.files().items():
        Path(name).write_text(text, encoding="utf-8")
        print(f"{name}: {len(text.splitlines())} lines")
    print(f"JAX: {in_jax['acceleration']:.4f} m/s^2, {in_jax['turn_rate']:.4f} rad/s")

    if shutil.which("gcc") is None:
        print("C: not compiled, as there is no gcc here")
        return
    command = ["gcc", "-std=c99", "-O2", "-shared", "-fPIC", "chase.c", "-lm", "-o", "chase.so"]
    subprocess.run(command, check=True)
    library = ctypes.CDLL(str(Path("chase.so").resolve()))
    acceleration = ctypes.c_float()
    turn_rate = ctypes.c_float()
    library.chase(
        (ctypes.c_float * 4)(*robot.tolist()),
        (ctypes.c_float * 2)(*target.tolist()),
        ctypes.byref(acceleration),
        ctypes.byref(turn_rate),
    )
    print(f"C:   {acceleration.value:.4f} m/s^2, {turn_rate.value:.4f} rad/s")


if __name__ == "__main__":
    main()
