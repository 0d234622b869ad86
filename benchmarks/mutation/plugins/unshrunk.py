"""A pytest plugin with a Hypothesis profile that does not minimise failing examples: a killed mutant needs no small example."""

from hypothesis import HealthCheck, Phase, settings

settings.register_profile(
    "unshrunk", deadline=None, derandomize=True, database=None, phases=(Phase.explicit, Phase.generate),
    suppress_health_check=[HealthCheck.too_slow],
)
