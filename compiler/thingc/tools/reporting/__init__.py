"""Format diagnostics as GitHub annotations or SARIF, and format the output of `thingc explain`."""
