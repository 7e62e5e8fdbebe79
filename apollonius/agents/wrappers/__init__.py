"""Players around another player: each changes what that one reads, values or does."""
