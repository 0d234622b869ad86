"""Create MuJoCo models without compiling them, by writing numbers into the arrays of a compiled model.

The class `Arrays` creates models for other numbers in a single XML text. The class `TextModels` creates models for many XML texts.
"""
