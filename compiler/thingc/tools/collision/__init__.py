"""Measure how well collision shapes approximate parts."""
