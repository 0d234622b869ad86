"""What a change touches: which documents depend on the files that changed. No Python of theirs is run to find out."""
