"""The kinds of joints (such as revolute or prismatic), the motions that they allow, and the keys that they accept in documents."""
