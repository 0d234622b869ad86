"""Gymnasium environments whose robots are the variants of a batch or the robots of a family."""
