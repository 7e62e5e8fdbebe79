"""Pictures: arenas with trails, curves, bars. The only place that draws."""
