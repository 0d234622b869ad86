"""The parts of MInchW, the magnetic inchworm climbing robot: the links between its six servos, its cells and its two magnets.

As in the arm, each part that holds a component places it at its mount and derives faces, holes and clearances from it, so these modules
repeat no dimension of a servo, cell or magnet. All holes of a part are cut in one boolean operation. `PLAY` is the clearance on each side
of a component in a printed part, and `GAP` is the clearance between moving and fixed parts [mm].
"""

from __future__ import annotations

PLAY = 0.1
GAP = 0.5
