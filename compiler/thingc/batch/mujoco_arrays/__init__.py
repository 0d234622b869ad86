"""Create MuJoCo models from others by writing arrays: for other numbers (`Arrays`), or for many texts (`TextModels`)."""
