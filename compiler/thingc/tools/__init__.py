"""The commands of thingc, its language server, importers of other formats, and reports."""
