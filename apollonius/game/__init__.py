"""The rules: one pure, unbatched transition."""
