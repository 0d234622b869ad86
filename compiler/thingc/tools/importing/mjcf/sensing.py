"""Convert the sensors and cameras of a MuJoCo model to sensors of the source model."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Set

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import Pose
from thingc.base.sensor_kinds import ReadingName, SensorType
from thingc.targets.mjcf.sensors import ELEMENTS, LOOKING
from thingc.tools.importing.mjcf.adding import Added
from thingc.tools.importing.mjcf.compiled_source import SITE, CompiledSource, pose_of
from thingc.tools.importing.mjcf.shapes import KINDS, sizes_of
from thingc.tools.importing.source_model import ShapeKind, SourceSensor, SourceTarget

SENSORS: dict[str, tuple[SensorType, ReadingName]] = {
    tag.removesuffix("actuatorfrc") + "actfrc" if tag in ("jointactuatorfrc", "tendonactuatorfrc") else tag: (kind, reading)
    for kind, elements in ELEMENTS.items() if kind not in ("imu", "contact") for reading, tag in elements.items()
}
"""The kind and the reading of each type of sensor in MuJoCo's enum `mjtSensor`."""
IMU: frozenset[SensorType] = frozenset({"accelerometer", "gyro"})


class _Place(FrozenStruct):
    """The kind of a sensor and the measured element: a site with an optional reference site, a joint, or a tendon."""

    kind: SensorType
    site: str | None = None
    seen_from: str | None = None
    joint: str | None = None
    tendon: str | None = None


class Sensing:
    """Reads the sensors and cameras of a MuJoCo model.

    `on` maps each imported body to a link and the pose of the body in this link. `driven` maps the index of an actuator to the driven joint
    or tendon, `root` is the root body, and `floating` contains the bodies of the link that is a free root.
    """

    def __init__(
        self, original: CompiledSource, on: Mapping[int, tuple[int, Pose]], added: Added, driven: Mapping[int, SourceTarget], root: int,
        floating: Set[int],
    ) -> None:
        import mujoco

        self.original, self.model, self.on, self.driven, self.root, self.floating = original, original.model, on, driven, root, floating
        self.added, self.tendons = added, added.tendons
        types = mujoco.mjtSensor.__members__.items()
        self.kinds: dict[int, str] = {int(value): name.removeprefix("mjSENS_").lower() for name, value in types}

    def all(self) -> tuple[SourceSensor, ...]:
        """Return the sensors and cameras that documents support. Several MuJoCo sensors of the same kind at one element become one sensor.

        Duplicates, and sensors that documents do not support, are added to the MuJoCo model unchanged or recorded as losses.
        """
        read: list[tuple[int, _Place, ReadingName]] = []
        placed_before: set[tuple[_Place, ReadingName] | None] = {None}
        for number in range(self.model.nsensor):
            placed = self._place(number)
            if placed is None or placed in placed_before:
                if self.added.sensor(number):
                    continue
                name, kind = self.original.sensors[number], self._kind(number)
                self.original.lose("sensor", number, f"sensor `{name}` of kind `{kind}`", "documents do not support the type of the sensor")
            else:
                placed_before.add(placed)
                read.append((number, *placed))
        at = {(place.kind, place.site) for _, place, _ in read}
        imus = {site for _, site in at if {kind for kind, other in at if other == site} >= IMU}
        made: dict[_Place, list[tuple[int, ReadingName]]] = {}
        for number, place, reading in read:
            of_imu = place.kind in IMU or (place.kind, reading, place.seen_from) == ("pose", "quat", None)
            if of_imu and place.site in imus:
                place = _Place(kind="imu", site=place.site)
            made.setdefault(place, []).append((number, reading))
        return (*(self._sensor(place, readings) for place, readings in made.items()), *self._cameras())

    def _kind(self, number: int) -> str:
        return self.kinds.get(int(self.model.sensor_type[number]), "sensor")

    def _place(self, number: int) -> tuple[_Place, ReadingName] | None:
        model, original = self.model, self.original
        thing, of = int(model.sensor_objid[number]), int(model.sensor_objtype[number])
        kind, reading = SENSORS.get(self._kind(number), (None, None))
        place = None
        match kind:
            case None:
                return None
            case "joint" if int(model.jnt_bodyid[thing]) in self.on:
                place = _Place(kind="joint", joint=original.joints[thing])
            case "drive" if thing in self.driven:
                what = self.driven[thing]
                place = _Place(kind="drive", tendon=what.name) if what.kind == "tendon" else _Place(kind="drive", joint=what.name)
            case "tendon" if thing in self.tendons:
                place = _Place(kind="tendon", tendon=self.tendons[thing].name)
            case "centre" if thing == self.root:
                place = _Place(kind="centre")
            case "clock" | "energy":
                place = _Place(kind=kind)
            case _ if of == SITE and int(model.site_bodyid[thing]) in self.on and int(model.sensor_dim[number]) <= 4:
                place = self._at_site(number, kind, thing)
        return None if place is None or reading is None else (place, reading)

    def _at_site(self, number: int, kind: SensorType, site: int) -> _Place | None:
        model, sites = self.model, self.original.sites
        reference, reference_type = int(model.sensor_refid[number]), int(model.sensor_reftype[number])
        if reference >= 0 and (reference_type != SITE or int(model.site_bodyid[reference]) not in self.on):
            return None
        if kind == "touch" and int(model.site_type[site]) not in KINDS:
            return None
        if kind == "force" and int(model.site_bodyid[site]) in self.floating:
            return None  # documents measure the force between links, and a free root has no parent
        return _Place(kind=kind, site=sites[site], seen_from=sites[reference] if reference >= 0 else None)

    def _sensor(self, place: _Place, readings: list[tuple[int, ReadingName]]) -> SourceSensor:
        """Combine several MuJoCo sensors at the same element to one sensor of the document."""
        model, original = self.model, self.original
        numbers: dict[str, dict[str, float]] = {"noise": {}, "cutoff": {}}
        for number, reading in readings:
            for key, values in numbers.items():
                value = float(getattr(model, f"sensor_{key}")[number])
                if value and reading in ("quat", "magnetometer", "momentum", "time"):
                    what = f"{key} of sensor `{original.sensors[number]}`"
                    original.lose("sensor", number, what, f"documents do not support the value for a `{reading}`")
                elif value:
                    values[reading] = value
        volume: tuple[ShapeKind, tuple[float, ...]] | None = None
        if place.kind == "touch":
            site = int(model.sensor_objid[readings[0][0]])
            shape = KINDS[int(model.site_type[site])]
            volume = shape, sizes_of(shape, model.site_size[site])
        parts = tuple((original.sensors[number], reading) for number, reading in readings)
        names = {name.removesuffix(f":{reading}") for name, reading in parts}
        has_own_name = all(name.endswith(f":{reading}") for name, reading in parts) and len(names) == 1
        return SourceSensor(
            kind=place.kind, name=names.pop() if has_own_name else place.site or place.joint or place.tendon or place.kind,
            where=original.where("sensor", readings[0][0]), site=place.site, seen_from=place.seen_from, joint=place.joint,
            tendon=place.tendon, volume=volume, parts=parts, noise=numbers["noise"], cutoff=numbers["cutoff"],
        )

    def _cameras(self) -> Iterator[SourceSensor]:
        model, original = self.model, self.original
        for number in range(model.ncam):
            body, where = int(model.cam_bodyid[number]), original.where("camera", number)
            why = "the camera tracks a target" if int(model.cam_mode[number]) else "" if body in self.on else "the camera is not on a link"
            if why:
                original.losses.note(f"camera `{original.cameras[number]}`", why, where)
                continue
            link, pose = self.on[body]
            yield SourceSensor(
                kind="camera", name=original.cameras[number], where=where, link=original.bodies[link],
                pose=pose @ pose_of(model.cam_pos[number], model.cam_quat[number]) @ LOOKING, fovy=math.radians(model.cam_fovy[number]),
            )
