"""Stock parts: bought components modelled from their published drawings, with every hole and face a named reference."""
