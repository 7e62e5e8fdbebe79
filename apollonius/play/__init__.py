"""The one game loop: step a batch of games with auto-reset, play given starts to their ends, replay one game."""
