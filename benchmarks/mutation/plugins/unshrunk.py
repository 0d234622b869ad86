"""A pytest plugin with a Hypothesis profile that does not minimise failing examples, because a failing test is sufficient to kill a
mutant.
"""

from hypothesis import HealthCheck, Phase, settings

settings.register_profile(
    "unshrunk", deadline=None, derandomize=True, database=None, phases=(Phase.explicit, Phase.generate),
    suppress_health_check=[HealthCheck.too_slow],
)
