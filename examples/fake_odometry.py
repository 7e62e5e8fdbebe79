"""Drive an exported player from fake odometry, as the node of `ros2/apollonius_ros` does.

    python examples/fake_odometry.py

No ROS is needed, but gcc. The player is written as C; the pilot takes what odometry reports, late
and with noise, and returns speed and turn rate ten times a second. After 4 s the evader's odometry
stops, and the pursuer brakes. It prints what the export prints, and then a line every second:

"""

import math
import random
import shutil
import subprocess
import sys
from pathlib import Path

from apollonius.cli.main import main as apollonius

sys.path.append(str(Path(__file__).resolve().parents[1] / "ros2" / "apollonius_ros"))
from apollonius_ros.export import Export
from apollonius_ros.pilot import Pilot, Robot

DT = 0.1
DELAY = 0.05
NOISE = 0.01
EVADER_SPEED = 0.4
SILENT_FROM = 4.0


def noisy(state):
    """Return a state as odometry reports it."""
    return tuple(number + random.gauss(0.0, NOISE) for number in state)


def moved(state, speed, turn_rate):
    """Return x [m], y [m], speed [m/s] and heading [rad] after a step."""
    x, y, _, heading = state
    heading = math.remainder(heading + turn_rate * DT, math.tau)
    return x + speed * DT * math.cos(heading), y + speed * DT * math.sin(heading), speed, heading


def main(player: str = "intercept", seconds: int = 10) -> None:
    """Export the player, and drive it against an evader that drives in a circle."""
    if shutil.which("gcc") is None:
        print("not driven, as there is no gcc here")
        return
    if apollonius(["export", player, "--to", "c", "--out", "driver.c"]) != 0:
        return
    command = ["gcc", "-std=c99", "-O2", "-shared", "-fPIC", "driver.c", "-lm", "-o", "driver.so"]
    subprocess.run(command, check=True)

    random.seed(0)
    robots = [Robot("pursuer"), Robot("evader")]
    pilot = Pilot(Export(Path("driver.robot.json")), robots)
    pursuer = (1.0, 5.0, 0.0, 0.0)
    evader = (6.0, 5.0, EVADER_SPEED, 0.0)
    for step in range(round(seconds / DT)):
        now = step * DT
        robots[0].see(noisy(pursuer), now - DELAY, now)
        if now < SILENT_FROM:
            robots[1].see(noisy(evader), now - DELAY, now)
        decision = pilot.command(now)
        if step % 10 == 0:
            distance = math.dist(pursuer[:2], evader[:2])
            orders = f"drive {decision.speed:.2f} m/s, {decision.turn_rate:+.2f} rad/s"
            print(f"{now:4.1f} s: {distance:.2f} m apart; {orders}  {decision.trouble}".rstrip())
        pursuer = moved(pursuer, decision.speed, decision.turn_rate)
        evader = moved(evader, EVADER_SPEED, 0.3)


if __name__ == "__main__":
    main()
