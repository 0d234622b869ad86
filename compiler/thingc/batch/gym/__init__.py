"""Gymnasium environments of families and batches."""
