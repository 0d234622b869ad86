"""What there is to say, for machines other than ours: GitHub's annotations, SARIF, and the pages of `thingc explain`."""
