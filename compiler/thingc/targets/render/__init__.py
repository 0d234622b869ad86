"""Render pictures of robots without a display: a MuJoCo model in one of its keyframes, in bright studio light.

    png = picture(xml, assets, pose="home", gravity=(0.0, 0.0, -9.81), shot=Shot())

MuJoCo, numpy and Pillow are imported when the first picture is made.
"""
