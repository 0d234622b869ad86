"""`html/<name>.html`: the robot in a browser, in one file without a request to anywhere.

`described.py` says what the page is told (plain data), `packed.py` packs the meshes, `target.py` puts both into the page. Its program,
style and frame are in `page/`: `viewer.js` is bundled from `viewer/` at the top of the repository (`make viewer`).
"""
