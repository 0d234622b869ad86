"""Render the pictures of an assembly book: finished pieces in grey, and new pieces in colour, on their way to their places."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import Pose, Vector, add_scaled
from thingc.base.primitives import Primitive
from thingc.geometry.store.local import Store
from thingc.model.assembly.types import Assembly, Occurrence
from thingc.targets.render.picture import Shot, camera_of, encode_png, points_of, pose_model

if TYPE_CHECKING:
    from thingc.tools.workshop.assembly_steps import AssemblyStep

SIZE, SMALL = (640, 480), (160, 120)
"""Sizes of the pictures of steps, and of parts in the bill of materials [px]."""
DONE, NEW, PATH = "0.80 0.81 0.83 1", "0.93 0.42 0.08 1", "0.1 0.1 0.12 1"
"""Colours of finished pieces, of new pieces, and of the lines along which they move."""
AZIMUTHS = (140.0, 230.0, 50.0, 320.0)
"""Directions of the camera [deg], in order of preference."""
CORNERS = 60
"""Number of corners of a new part whose visibility is checked."""
GRAVITY = (0.0, 0.0, -9.81)
CLEARANCE = 0.012
"""The distance [m] between a new piece and its place, in addition to its own length."""


class _ColoredPart(FrozenStruct, eq=False):
    occurrence: Occurrence
    pose: Pose
    color: str


class Pictures:
    """Renders pictures of a robot at q = 0. `ready` of `targets/render/picture.py` must be called before."""

    def __init__(self, assembly: Assembly, store: Store) -> None:
        self._assembly, self._store = assembly, store

    def part(self, occurrence: Occurrence) -> str | None:
        """Return a small picture of a part as a `data:` URL, or None if it has no shapes for display."""
        color = " ".join(f"{int(occurrence.color[k : k + 2], 16) / 255.0:.3g}" for k in (1, 3, 5)) + " 1" if occurrence.color else DONE
        return self._render([_ColoredPart(occurrence=occurrence, pose=Pose(), color=color)], [], SMALL)

    def step(self, done: Iterable[Occurrence], step: AssemblyStep, base: Occurrence) -> str | None:
        """Return the picture of a step as a `data:` URL, in the frame of the occurrence `base`.

        Return None if the new pieces have no shapes for display.
        """
        if not any(one.drawn for piece in step.pieces for one in piece.occurrences):
            return None
        to_base = self._assembly.rest[base.index].inverse()
        parts = [_ColoredPart(occurrence=one, pose=to_base @ self._assembly.rest[one.index], color=DONE) for one in done]
        lines: list[tuple[Vector, Vector]] = []
        for piece, direction in zip(step.pieces, step.directions, strict=True):
            shift = np.zeros(3)
            if direction is not None:
                direction_in_base = np.array(to_base.rotation) @ np.array(direction)
                shift = direction_in_base * self._distance(piece.occurrences, to_base, direction_in_base)
            for one in piece.occurrences:
                pose = to_base @ self._assembly.rest[one.index]
                moved = Pose(rotation=pose.rotation, translation=add_scaled(pose.translation, _vector(shift), 1.0))
                parts.append(_ColoredPart(occurrence=one, pose=moved, color=NEW))
            if direction is not None:
                mate = piece.mate
                assert mate is not None
                seat = (to_base @ self._assembly.rest[mate.parent] @ mate.X_PJ).translation
                lines.append((seat, add_scaled(seat, _vector(shift), 1.0)))
        return self._render(parts, lines, SIZE)

    def _distance(self, occurrences: Sequence[Occurrence], to_base: Pose, direction: NDArray[np.float64]) -> float:
        """Return the distance [m] by which a piece is away from its place: its length along its way, and a gap."""
        boxes = [(to_base @ self._assembly.rest[one.index]).around(one.box) for one in occurrences if one.box is not None]
        if not boxes:
            return CLEARANCE
        corners = np.array(boxes)
        return float(np.abs(direction) @ (corners[:, 1].max(axis=0) - corners[:, 0].min(axis=0))) + CLEARANCE

    def _render(self, parts: Sequence[_ColoredPart], lines: Sequence[tuple[Vector, Vector]], size: tuple[int, int]) -> str | None:
        import mujoco

        from thingc.targets.render import studio

        assets: dict[str, bytes] = {}
        geoms = [geom for one in parts for geom in self._geoms(one, assets)]
        if not geoms:
            return None
        meshes = "".join(f'<mesh name="{name[:-4]}" file="{name}" inertia="shell"/>' for name in assets)

        def text(height: float, thickness: float) -> str:
            drawn = "".join(
                f'<geom type="capsule" size="{thickness:.6g}" fromto="{_numbers(a)} {_numbers(b)}" rgba="{PATH}"/>' for a, b in lines
            )
            body = f'<body pos="0 0 {height:.6g}">{"".join(geoms)}{drawn}</body>'
            return f"<mujoco><asset>{meshes}</asset><worldbody>{body}</worldbody></mujoco>"

        bare = mujoco.MjModel.from_xml_string(text(0.0, 1e-4), assets)
        points = points_of(bare, pose_model(bare, None))
        length = float(np.linalg.norm(np.ptp(points, axis=0)))
        height = -float(points[:, 2].min())
        points[:, 2] += height
        model = studio.model_of(text(height, 0.003 * length), assets, size, 0.0, studio.COARSE)
        cameras = [camera_of(points, GRAVITY, Shot(size=size, azimuth=azimuth)) for azimuth in AZIMUTHS]
        colors = [one.color for one in parts for _ in one.occurrence.drawn]
        first = int(model.body_geomadr[1])  # the floor comes before the geoms of the body
        new = [first + k for k, color in enumerate(colors) if color == NEW]
        camera = cameras[_clearest_camera(model, [camera.position for camera in cameras], new)]
        middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
        image = studio.render(model, pose_model(model, None), camera, size, middle, 0.75 * length, studio.COARSE)
        return f"data:image/png;base64,{b64encode(encode_png(image)).decode()}"

    def _geoms(self, part: _ColoredPart, assets: dict[str, bytes]) -> Iterable[str]:
        for surface in part.occurrence.drawn:
            solid = surface.solid
            if isinstance(solid, Primitive):
                pose, kind = part.pose @ surface.pose @ solid.pose, f'type="{solid.shape}" size="{_numbers(solid.size)}"'
            else:
                name = f"{solid.sha256}.obj"
                assets[name] = self._store.read(solid.sha256)
                pose, kind = part.pose @ surface.pose, f"type=\"mesh\" mesh={quoteattr(solid.sha256)}"
            yield f'<geom {kind} pos="{_numbers(pose.translation)}" quat="{_numbers(pose.quaternion())}" rgba="{part.color}"/>'


def _clearest_camera(model: Any, cameras: Sequence[NDArray[np.float64]], geoms: Sequence[int]) -> int:
    """Return the index of the first of several positions of the camera from which most of the corners of geoms are visible."""
    import mujoco

    data = pose_model(model, None)
    corners = []
    for geom in geoms:
        mesh = int(model.geom_dataid[geom])
        if mesh >= 0:
            start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            local = model.mesh_vert[start : start + count][:: max(1, count // CORNERS)].astype(float)
            corners.append(local @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
    seen = [0] * len(cameras)
    for index, camera in enumerate(cameras):
        for corner in (one for group in corners for one in group):
            distance = mujoco.mj_ray(model, data, camera, corner - camera, None, 1, -1, np.zeros(1, dtype=np.int32))
            seen[index] += distance > 0.999
    return next(index for index, number in enumerate(seen) if number >= 0.8 * max(seen))


def _vector(values: NDArray[np.float64]) -> Vector:
    x, y, z = values.tolist()
    return x, y, z


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{value:.9g}" for value in values)
