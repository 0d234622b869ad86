"""USD: a stage of UsdPhysics for each mode, for Isaac Sim, Newton and whatever else reads it."""
