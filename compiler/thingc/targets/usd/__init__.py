"""USD: a UsdPhysics stage for each mode, for Isaac Sim, Newton and other readers."""
