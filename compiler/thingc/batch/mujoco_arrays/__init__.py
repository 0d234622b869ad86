"""Create MuJoCo models without compiling them, by writing numbers into the arrays of a compiled model.

`Arrays` creates models for other numbers in one XML text. `TextModels` creates models for many XML texts.
"""
