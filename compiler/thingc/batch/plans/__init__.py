"""Plans: recorded computations that give the results of compilations for other numbers. `Builds` gives whole builds."""
