"""`parts.lock.json`: what parts take and are, written down beside the documents, and asked in their place."""
