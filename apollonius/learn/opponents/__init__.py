"""Whom the sides of self-play meet: each other's learners, and earlier versions by a scheme."""
