"""What a part's result depends on (code, files that it read, versions), and the cache of results by these."""
