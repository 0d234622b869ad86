"""Kinds of document tests (`tests:` of a document). Each module defines one kind: its model, how it is read, and how it is measured.

A module of this folder with a `KIND` defines a kind (`thingc.documents.checks`). It is imported to read a document. Therefore, it imports
modules of rooms after `documents/` only inside functions.
"""
