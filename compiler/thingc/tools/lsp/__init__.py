"""The language server of thingc, which editors start with `thingc lsp`.

It analyses the unsaved text of documents. The entry point is `server`.
"""
