"""The one game loop: step a batch of games, play starts to their ends, replay one."""
