"""The kinds of robots by their names in game files."""

from apollonius.game.car import Car
from apollonius.game.dynamics import Unicycle
from apollonius.game.omni import Omni
from apollonius.game.wheels import Wheels
from apollonius.io.errors import require

MODELS: dict[str, type[Unicycle]] = {
    "unicycle": Unicycle,
    "car": Car,
    "wheels": Wheels,
    "omni": Omni,
}
"""Another kind of robot extends `Unicycle` and is named here."""


def model_name(body: Unicycle) -> str:
    """Return the name of a robot's kind."""
    return next(name for name, kind in MODELS.items() if type(body) is kind)


def require_unicycle(body: Unicycle, name: str, caller: str) -> None:
    """Refuse robots of other kinds, for `caller` knows unicycles only; raises InvalidInput."""
    bound = f"'unicycle': {caller} knows no other kind"
    require(type(body) is Unicycle, f"{name}.model", model_name(body), bound)
