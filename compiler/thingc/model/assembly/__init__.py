"""Linking: the resolved model and the part records become occurrences, mates and links, before a root is chosen."""
