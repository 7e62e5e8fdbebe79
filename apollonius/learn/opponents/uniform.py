"""All earlier versions equally likely: fictitious self-play (Heinrich, Lanctot, Silver, 2015)."""

from apollonius.learn.opponents.scheme import AbstractScheme


class Uniform(AbstractScheme):
    """Every version as likely as another."""


SCHEME = Uniform()
