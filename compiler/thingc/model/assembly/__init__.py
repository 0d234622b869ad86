"""The pass `link`, which converts the resolved model and the part records to occurrences, mates and links. The pass does not choose a root.
"""
