"""Earlier versions by how hard they are to beat: AlphaStar's f_hard (Vinyals et al., 2019)."""

from jaxtyping import Array, Float

from apollonius.learn.opponents.scheme import AbstractScheme


class PrioritisedHard(AbstractScheme):
    """A version that lost a share w of its games weighs (1 - w)^2."""

    keeps_records = True

    def weigh(self, lost: Float[Array, " versions"]) -> Float[Array, " versions"]:
        """The more likely, the less it lost."""
        return (1 - lost) ** 2


SCHEME = PrioritisedHard()
