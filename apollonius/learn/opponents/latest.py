"""Each other's latest versions, and nobody else: Algorithm 2 of the paper."""

from apollonius.learn.opponents.scheme import AbstractScheme


class Latest(AbstractScheme):
    """No game with an earlier version."""

    share = 0.0


SCHEME = Latest()
