"""The true shapes of parts, as meshes without gaps, and what lies in what."""
