"""What documents state of their sensors."""

from __future__ import annotations

from collections.abc import Iterator

from thingc.model.assembly.types import Assembly, LinkedSensor
from thingc.tools.diff.snapshot import Named, Value


def sensor_values(assembly: Assembly, sensor: LinkedSensor) -> Iterator[tuple[tuple[str, ...], Value]]:
    """By its keys what a sensor is, where it sits, and what of it is stated (None: not)."""
    yield ("type",), sensor.kind
    for key, mount in (("at", sensor.at), ("in", sensor.seen_from)):
        if mount is not None:
            yield (key,), Named(what="component", path=assembly.occurrences[mount.occurrence].path, mount=mount.mount)
    yield ("fovy",), sensor.fovy
    yield ("joint",), None if sensor.joint is None else Named(what="joint", path=sensor.joint)
    yield ("tendon",), sensor.tendon
    for key, link in zip(("of", "with"), sensor.touching, strict=False):
        yield (key,), Named(what="component", path=assembly.occurrences[assembly.links[link].frame].path)
    if sensor.volume is not None:
        yield ("volume", sensor.volume.shape), sensor.volume.size
    for reading in dict.fromkeys((*sensor.noise, *sensor.cutoff)):
        yield ("noise", reading), sensor.noise.get(reading)
        yield ("cutoff", reading), sensor.cutoff.get(reading)
