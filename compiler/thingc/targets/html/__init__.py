"""Write `html/<name>.html`, a self-contained page that shows the robot in a browser.

`viewer_data.py` collects the data for the page, `mesh_packing.py` packs the meshes, and `emit.py` puts both into the page. The folder
`page/` contains the script, the style sheet and the HTML frame. The script `viewer.js` is bundled from the folder `viewer/` of the
repository (`make viewer`).
"""

from thingc.targets.target import Target

TARGET = Target(
    position=10, says="the robot in a browser", emitter="thingc.targets.html.emit:emit", writes=("html/*.html",), unasked=False,
    files={"html/NAME.html": "a page that shows all modes of the robot"}, numbers_in_text=False,
)
