"""All earlier versions equally likely: fictitious self-play (Heinrich, Lanctot, Silver, 2015)."""

from apollonius.learn.opponents.scheme import AbstractScheme


class FictitiousSelfPlay(AbstractScheme):
    """Every version as likely as another."""


SCHEME = FictitiousSelfPlay()
