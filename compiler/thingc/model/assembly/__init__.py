"""Linking: convert the resolved model and the part records to occurrences, mates and links. No root is chosen yet."""
