"""Gymnasium environments that simulate the variants of a batch or the robots of a family."""
