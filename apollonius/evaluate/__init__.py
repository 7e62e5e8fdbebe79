"""Judging: matches with counts and intervals. Never trains."""
