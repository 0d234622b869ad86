"""Plans: recordings of a compilation that repeat its computations with other numbers. The class `Builds` creates whole builds with plans.
"""
