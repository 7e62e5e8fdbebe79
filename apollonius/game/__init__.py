"""The rules of the game: pure, unbatched, one transition at a time."""
