"""Kinds of document tests (`tests:` of a document). Each module defines one kind: its model, how it is read, and how it is measured.

A module of this folder with a `KIND` defines a kind (`thingc.documents.checks`). Such a module is imported to read a document. Therefore
the module imports later rooms than `documents/` only inside functions.
"""
