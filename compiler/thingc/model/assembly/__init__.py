"""Linking: convert the resolved model and the part records to occurrences, mates and links. Linking does not choose a root."""
