"""Find the documents that depend on changed files, without running Python code of the workspace."""
