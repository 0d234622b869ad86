"""Pictures of robots: a MuJoCo model in one of its keyframes, photographed in a bright studio, without a screen.

    png = picture(xml, assets, pose="home", up=(0, 0, 1), shot=Shot())

MuJoCo, numpy and Pillow are imported when the first picture is made.
"""

from __future__ import annotations

from thingc.targets.render.picture import NoGraphics, Shot, picture, ready
from thingc.targets.render.series import body_poses, extent, small_picture

__all__ = ["NoGraphics", "Shot", "body_poses", "extent", "picture", "ready", "small_picture"]
