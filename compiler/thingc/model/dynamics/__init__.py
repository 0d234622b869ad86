"""Motions of joints in time, and the loads that they cause."""
