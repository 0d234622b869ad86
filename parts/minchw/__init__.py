"""The parts of MInchW, the magnetic inchworm climbing robot: the links between its six servos, its cells and its two magnets.

The dimensions of servos, cells and magnets are not repeated: a part that carries a component derives its faces, holes and clearances from
the placed component. A single boolean operation cuts all holes of a part. `PLAY` is the clearance on each side of a component in a printed
part, and `GAP` is the clearance between moving and fixed parts [mm].
"""

from __future__ import annotations

PLAY = 0.1
GAP = 0.5
