"""Create JSON Schemas for editors, one for each document.

A schema contains the parts, mounts, joints and other names that the document can use.
"""
