"""Stock parts: commercial components modelled from published drawings. Every hole and face has a name."""
