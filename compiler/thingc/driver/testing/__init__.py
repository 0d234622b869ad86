"""Run the tests that a document defines for its robot, as `thingc test` does."""
