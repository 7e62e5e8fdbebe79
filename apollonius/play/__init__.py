"""The one game loop: a batch of games with auto-reset, starts played to their ends, replays."""
