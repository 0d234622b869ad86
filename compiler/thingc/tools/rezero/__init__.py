"""Move zeros of joints in documents."""
