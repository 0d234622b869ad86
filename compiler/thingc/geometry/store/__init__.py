"""The store: what is kept by content, of this machine or of several, and who is modelling what for it."""
