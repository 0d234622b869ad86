"""The language server of thingc, which editors start with `thingc lsp`.

The server analyses the unsaved text of documents. The entry point is the module `server`.
"""
