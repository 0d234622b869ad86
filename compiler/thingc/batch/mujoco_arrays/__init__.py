"""Create MuJoCo models from other models by writing arrays: for other numbers (`Arrays`), or for many XML models (`TextModels`)."""
