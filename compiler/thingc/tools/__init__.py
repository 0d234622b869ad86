"""The commands of thingc, the language server, importers of other formats, and reports."""
