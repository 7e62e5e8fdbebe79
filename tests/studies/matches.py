"""What a match of no games comes to: tests put in what they look at."""

from apollonius.evaluate.match import MatchResult

NO_MATCH = MatchResult(1, {}, 0.0, (0.0, 1.0), 0.0, (0.0, 1.0), 0.0, 0.0, None, 0.0)
