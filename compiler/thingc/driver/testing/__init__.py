"""Running the tests that a document states of its robot: `thingc test`."""
