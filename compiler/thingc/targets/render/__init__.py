"""Pictures of robots: a MuJoCo model in one of its keyframes, photographed in a bright studio, without a screen.

    png = picture(xml, assets, pose="home", up=(0, 0, 1), shot=Shot())

MuJoCo, numpy and Pillow are imported when the first picture is made.
"""
