"""Plans: what compilations make of settings, worked out again for other numbers without a compilation. `Builds` gives whole builds so."""
