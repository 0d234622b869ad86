"""Plans are recordings of a compilation, which repeat its computations with other numbers.

The class `Builds` uses plans to create whole builds.
"""
