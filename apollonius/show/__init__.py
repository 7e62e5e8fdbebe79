"""Pictures: arenas, trails, curves, slices, animations, reports."""
