"""Find the documents that depend on changed files, without running their Python code."""
