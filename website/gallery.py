"""The gallery of arenas: a card for each, with its picture, its numbers, its file, and a link that plays there."""

from html import escape

import tomli_w

from apollonius.arenas.file import GALLERY, about_game, find_game, game_names
from apollonius.arenas.record import to_dict
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.show.arena import draw_arena
from apollonius.show.style import inline_svg

_INCHES = 3.6
"""The longer side of an arena's picture."""


def cards() -> str:
    """MyST source: a section for each game that ships with the package."""
    return "\n## Arena by arena\n\n" + "\n".join(_card(name, find_game(name)) for name in game_names())


def _card(name: str, game: Game) -> str:
    arena = game.arena
    width, height = float(arena.x_max - arena.x_min), float(arena.y_max - arena.y_min)
    scale = _INCHES / max(width, height)
    label = f"The arena {name} from above"
    picture = inline_svg(lambda axes: draw_arena(axes, arena), label, scale * width + 0.8, scale * height + 0.7)
    numbers = {
        "size": f"{width:g} m by {height:g} m",
        "obstacles": _obstacles(game),
        "capture": f"centres closer than {float(game.capture_distance):g} m",
        "pursuer": _limits(game.pursuer),
        "evader": "the same" if game.evader == game.pursuer else _limits(game.evader),
        "longest game": f"{game.max_steps * float(game.dt):g} s",
    }
    rows = "".join(f"<tr><th scope='row'>{key}</th><td>{escape(value)}</td></tr>" for key, value in numbers.items())
    return f"""### {name}

{about_game(name)}

```{{raw}} html
<div class="arena-card">
<div class="picture">{picture}</div>
<div><table class="table">{rows}</table>
<p><a class="play" href="playground/index.html?game={name}">Play here</a></p></div>
</div>
<details><summary>Its file</summary>
```

```toml
{_file(name, game).strip()}
```

```{{raw}} html
</details>
```
"""


def _file(name: str, game: Game) -> str:
    """What a file says that makes this game: the one that ships, or all numbers of a preset."""
    path = GALLERY / f"{name}.toml"
    return path.read_text() if path.exists() else tomli_w.dumps(to_dict(game))


def _obstacles(game: Game) -> str:
    counts = {"disc": len(game.arena.discs), "polygon": len(game.arena.polygons)}
    found = ", ".join(f"{count} {kind}{'s' * (count > 1)}" for kind, count in counts.items() if count)
    return found or "none"


def _limits(robot: Unicycle) -> str:
    """A robot's limits in words."""
    return (
        f"{robot.v_min:g} to {robot.v_max:g} m/s, {robot.u1_max:g} m/s², {robot.u2_max:g} rad/s, "
        f"radius {robot.radius:g} m"
    )
