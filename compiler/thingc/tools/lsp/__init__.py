"""`thingc lsp`: the language server, which analyses unsaved text. The entry point is `server`."""
