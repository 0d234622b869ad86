"""`thingc lsp`: the language server, which works on unsaved text. Start reading at `server`."""
