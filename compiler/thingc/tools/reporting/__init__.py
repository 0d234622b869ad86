"""Format reports for other programs: GitHub annotations, SARIF, and the pages of `thingc explain`."""
