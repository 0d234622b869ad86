"""The parts of MInchW, the magnetic inchworm climbing robot: the links between its six servos, its cells and its two magnets.

As in the arm, every fixture places its component by the mount where that will sit, and takes faces, holes and clearances from there, so
that no dimension of a servo, a cell or a magnet is repeated here. All holes of a part are cut in one boolean. `PLAY` is the clearance on
each side of a component in a printed part, `GAP` that between moving and fixed parts [mm].
"""

from __future__ import annotations

PLAY = 0.1
GAP = 0.5
