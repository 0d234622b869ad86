"""`thingc lsp`: what an editor asks while somebody types, answered from unsaved text. Start reading at `server`."""
