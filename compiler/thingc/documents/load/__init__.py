"""Reading documents: text to trees whose every key and value has a position; nothing is interpreted here."""
