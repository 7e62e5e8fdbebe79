"""Play one game between two agents, and draw it.

    python examples/play.py

It writes game.png (the end of the game, with both trails) and game.json (a replay), and prints:

     0.0 s: pursuer at (0.6, 2.2) m, evader at (1.0, 8.5) m
     2.0 s: pursuer at (0.2, 2.4) m, evader at (1.1, 8.8) m
     4.0 s: pursuer at (0.7, 3.8) m, evader at (1.8, 9.3) m
     6.0 s: pursuer at (2.2, 5.6) m, evader at (3.5, 9.4) m
     8.0 s: pursuer at (3.9, 7.1) m, evader at (4.1, 8.7) m
    captured after 9.1 s
"""

from pathlib import Path

import apollonius
from apollonius.show.animation import save_animation


def main(pursuer: str = "P_curriculum", evader: str = "E_scratch", out: str = "game.png") -> None:
    """Play a game in `paper`; `out` may also end in .gif or .webp, and then moves."""
    match = apollonius.Match.of_names("paper", pursuer, evader, games=1)
    replay = apollonius.record_game(match, 0)

    for step in range(0, len(replay.states), 20):
        red_x, red_y, _, _, blue_x, blue_y, _, _ = replay.states[step]
        red = f"({red_x:.1f}, {red_y:.1f}) m"
        blue = f"({blue_x:.1f}, {blue_y:.1f}) m"
        print(f"{step / 10:4.1f} s: pursuer at {red}, evader at {blue}")
    print(replay.ending())

    save_animation(replay, Path(out))
    apollonius.save_replay(replay, Path(out).with_suffix(".json"))


if __name__ == "__main__":
    main()
