"""Plans: recorded computations that repeat a compilation for other numbers. `Builds` creates whole builds with plans."""
