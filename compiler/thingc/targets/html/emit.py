"""Write `html/<name>.html`, a page that contains the viewer with its style sheet, script, data and meshes."""

from __future__ import annotations

import base64
import html
from importlib import resources

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.safe_text import html_text, in_script, pieces
from thingc.targets.artifact import Artifacts
from thingc.targets.html.mesh_packing import PackedMeshes
from thingc.targets.html.viewer_data import describe
from thingc.targets.request import EmitRequest

_AGAINST = (
    '<script id="thingc-against-robot" type="application/json">{data}</script>\n'
    '<script id="thingc-against-geometry" type="text/plain">{glb}</script>'
)


class Page(FrozenStruct):
    """The content of a web page. `name` is the name of the robot, `data` contains JSON data, and `glb` contains the meshes."""

    name: str
    data: str
    glb: bytes

    def html(self, *, live: str | None = None, editor: str | None = None, against: Page | None = None) -> bytes:
        """Return the HTML text of the page.

        If `live` is given, it identifies the version of the page. The page then asks its server for later versions. `editor` is a URL
        template that opens a file in an editor. The template contains `{file}` (the path in the workspace) and `{line}`. `against` is the
        page of another robot with which this robot is compared.
        """
        own = resources.files("thingc.targets.html") / "page"
        texts = {
            "@STYLE@": (own / "viewer.css").read_text(encoding="utf-8"), "@SCRIPT@": (own / "viewer.js").read_text(encoding="utf-8"),
            "@TITLE@": html_text(self.name), "@LIVE@": "\n".join(
                f'<meta name="thingc-{name}" content="{html.escape(content)}">'
                for name, content in (("live", live), ("editor", editor)) if content is not None
            ),
            "@CONNECT@": "'none'" if live is None else "'self'", "@ROBOT@": self.data, "@GEOMETRY@": base64.b64encode(self.glb).decode(),
            "@AGAINST@": "" if against is None else _AGAINST.format(data=against.data, glb=base64.b64encode(against.glb).decode()),
        }
        frame = pieces((own / "viewer.html").read_text(encoding="utf-8"))
        return "".join(texts.get(piece, piece) for piece in frame).encode()

    def news(self) -> bytes:
        """Return the data and meshes of the page as a JSON message that updates a live page.

        `robot` and `geometry` must come from the same build.
        """
        return f'{{"robot": {self.data}, "geometry": "{base64.b64encode(self.glb).decode()}"}}'.encode()


def waiting(name: str, editor: str | None = None) -> bytes:
    """Return a live page that waits for the first successful build, and then shows the robot. Until then, the title of the page is
    `name`.
    """
    return Page(name=name, data="null", glb=b"").html(live="", editor=editor)


def page_of(request: EmitRequest) -> Page:
    """Create the web page of a robot in all chosen modes. Raises `BlobMissing` if a mesh is missing in the store."""
    packed = PackedMeshes(request.store)
    data = describe(request.assembly, request.robots, request.workspace, packed)
    return Page(name=request.assembly.name, data=in_script(data), glb=packed.glb())


def emit(request: EmitRequest) -> Artifacts:
    """Write the HTML page of the robot. The target has no export losses, because the page shows the whole assembly."""
    return Artifacts(files={f"html/{request.assembly.name}.html": page_of(request).html()})
