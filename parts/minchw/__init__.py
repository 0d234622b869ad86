"""The parts of MInchW, the magnetic inchworm climbing robot: what links its six servos, its cells and its two magnets.

As in the arm, every fixture places what it holds by the mount where that will sit, and takes faces, holes and clearances
from there: no dimension of a servo, a cell or a magnet is written here. All holes of a part are cut in one boolean.

`PLAY` is the room on each side of what goes into a printed part, `GAP` that between what moves and what does not [mm].
"""

from __future__ import annotations

PLAY = 0.1
GAP = 0.5
