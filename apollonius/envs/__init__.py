"""Other people's interfaces to the same game."""
