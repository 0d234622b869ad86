"""The pass `link`, which converts the resolved model and the part records to occurrences, mates and links.

The result does not depend on the root of a mode.
"""
