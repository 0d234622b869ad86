"""Run the tests of a document on its robot, as `thingc test` does."""
