"""Motions of a document in simulators."""
