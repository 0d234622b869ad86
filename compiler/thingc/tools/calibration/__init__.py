"""Calibrate physical robots."""
