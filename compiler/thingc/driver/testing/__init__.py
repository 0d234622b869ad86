"""Run the tests of a document on its robot: `thingc test`."""
