"""Read documents: parse their text into trees in which every key and value has a source position.

Later passes interpret the values of the tree.
"""
