"""Read documents: text becomes trees in which every key and value has a position. Nothing is interpreted here."""
