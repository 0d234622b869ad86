"""Create JSON Schemas for editors, one for each document.

Each schema contains the parts, mounts, joints and other names that the document can use.
"""
