"""Commands, the language server, importers and reports."""
