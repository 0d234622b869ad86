"""The kinds of joints, with the twists of their coordinates and the limits that they accept."""
