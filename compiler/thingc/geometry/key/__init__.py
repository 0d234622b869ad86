"""Dependencies of a part's result (code, files that the part read, versions), and the cache with these dependencies as keys."""
