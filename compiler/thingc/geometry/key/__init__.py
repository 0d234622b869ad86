"""Dependencies of a part's result (code, files that it read, versions), and the cache of results that is keyed by them."""
