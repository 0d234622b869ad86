"""Compare two robots as mechanisms, independently of roots, names, link frames, joint zeros and joint signs."""
