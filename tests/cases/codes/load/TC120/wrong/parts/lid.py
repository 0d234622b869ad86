"""Parts of the workspace go here."""
