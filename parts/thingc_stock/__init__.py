"""Stock parts: commercial components modelled from published drawings. Every hole and face of a stock part has a name."""
