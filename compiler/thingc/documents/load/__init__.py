"""Read documents: convert text to trees in which every key and value has a position. Values are not interpreted here."""
