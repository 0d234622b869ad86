"""Render pictures of robots: a MuJoCo model in one of its keyframes, in bright studio light, without a display.

    png = picture(xml, assets, pose="home", gravity=(0.0, 0.0, -9.81), shot=Shot())

MuJoCo, numpy and Pillow are imported when the first picture is made.
"""
