"""Linking: the resolved model and the part records to occurrences, mates and links, before any root is chosen."""
