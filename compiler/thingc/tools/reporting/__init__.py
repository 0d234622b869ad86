"""Reports in other formats: GitHub annotations, SARIF, and the pages of `thingc explain`."""
