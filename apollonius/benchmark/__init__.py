"""The benchmark: suites judged, the cards of agents, scenarios with a proved winning line."""
