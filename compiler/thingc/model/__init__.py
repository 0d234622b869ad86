"""From documents and part records to assemblies, robots, loads."""
