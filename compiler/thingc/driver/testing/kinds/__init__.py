"""Kinds of document tests (`tests:` of a document), one module each: what is written, what is read from it, how it is measured.

A module of this folder with a `KIND` is a kind (`thingc.documents.checks`). It is imported to read a document, so it imports rooms after
`documents/` inside functions.
"""
