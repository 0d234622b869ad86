"""What of a robot's geometry MuJoCo cannot take, or takes otherwise."""

from __future__ import annotations

from thingc.base.diagnostics import Report
from thingc.base.memo import Memo
from thingc.base.primitives import Primitive
from thingc.geometry.record import Mesh
from thingc.model.assembly.types import Assembly, Occurrence
from thingc.targets.artifact import Loss
from thingc.targets.geometry import Geometry, MeshAsset, geometry, has_inside, inputs_of

LEAST_VOLUME = 1e-14
"""Of a part [m^3]: MuJoCo refuses solid meshes of up to 1e-15 (mjMINVAL), and a mesh holds somewhat less than its part."""

FOLDER = "mjcf/assets"
"""Where the meshes of all models lie."""


def taken(assembly: Assembly, report: Report, memo: Memo) -> tuple[Geometry, tuple[Loss, ...]]:
    """The geometry of every occurrence; what MuJoCo cannot take is reported, what it takes differently is a loss."""
    shapes, losses, said = memo("geometry", lambda _: _collected(assembly), inputs_of(assembly))
    for diagnostic in said.diagnostics:
        report.say(diagnostic)
    return shapes, losses


def is_shell(mesh: MeshAsset) -> bool:
    """Whether MuJoCo must take a mesh as a surface (`inertia="shell"`): one that encloses no volume, or almost none."""
    return mesh.mesh.flat or not mesh.mesh.closed or mesh.volume < LEAST_VOLUME


def _collected(assembly: Assembly) -> tuple[Geometry, tuple[Loss, ...], Report]:
    limits = _Limits()
    shapes = geometry(assembly, FOLDER, limits.takes, limits.report, own=True)
    return shapes, tuple(limits.losses), limits.report


class _Limits:
    def __init__(self) -> None:
        self.report = Report()
        self.losses: list[Loss] = []

    def takes(self, occurrence: Occurrence, piece: Mesh | Primitive) -> bool:
        """Whether MuJoCo can touch with a shape; what is lost with it, or by it, is noted."""
        choice = occurrence.overrides.collision
        if has_inside(piece):
            return True
        self.flat(occurrence, (
            f"the {choice} that encloses it has no volume" if isinstance(piece, Primitive)
            else "the points of its collision mesh lie in one plane"
        ))
        return False

    def flat(self, occurrence: Occurrence, why: str) -> None:
        what = f"its contacts: {why}, and MuJoCo needs a solid to touch"
        self.losses.append(Loss.of(occurrence.origin, "mjcf", None, occurrence.path, what, "omitted"))
