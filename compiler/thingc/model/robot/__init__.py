"""Build the kinematic tree of a robot for each mode. The meaning of joint coordinates does not depend on the root."""
