"""Models of MuJoCo that come of others by writing arrays: of numbers that differ (`Arrays`), or of many texts (`TextModels`)."""
