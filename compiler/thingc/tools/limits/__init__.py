"""The search of `thingc limits` for positions of joints in which no parts touch."""
