"""Read documents: parse their text into trees in which every key and value has a source position.

Values are interpreted by later passes.
"""
