"""`html/<name>.html`: the robot in a browser, in one self-contained file.

`viewer_data.py` collects the data for the page, `mesh_packing.py` packs the meshes, and `emit.py` puts both into the page. The script,
style sheet and HTML frame are in `page/`. `viewer.js` is bundled from `viewer/` at the top of the repository (`make viewer`).
"""

from thingc.targets.target import Target

TARGET = Target(
    position=10, says="the robot in a browser", emitters=("thingc.targets.html.emit:emit",), writes=("html/*.html",), unasked=False,
    files={"html/NAME.html": "the robot in a browser, all modes"}, numbers_in_text=False,
)
