"""What a part's answer depends on: code, files that were read, versions; and the answers that are kept by that."""
