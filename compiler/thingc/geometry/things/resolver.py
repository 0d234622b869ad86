"""Moved views of Things: read-only proxies that transform all attributes of a Thing to another frame."""

from __future__ import annotations

import copy
import dataclasses
import functools
import types
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

from build123d import Axis, BoundBox, Joint, Location, Matrix, OrientedBoundBox, Plane, Vector
from build123d.build_common import Builder, LocationList
from build123d.topology import Shape, downcast

from thingc.geometry.things.actuator import Actuator


class Framed(ABC):
    """An object whose frame can be expressed in another frame: a Thing, a mount, or a moved view."""

    __slots__ = ()

    @abstractmethod
    def _in_frame(self, view: Location) -> Any:
        """Return a copy of this object that is expressed in another frame. `view` [mm] is the pose of the object's own frame in the other
        frame.
        """


class TransformResolver(Framed):
    """A moved view of a Thing. Every attribute of the view is expressed in the local frame, including items of lists and return values of
    methods.

    `thing.move(location)` and `mount.align(other)` return such views. In `TransformResolver(thing, location)`, the frame of `thing` is at
    `location` [mm]. A view is only used while geometry is constructed. Views do not add components to an assembly. The function `place`
    transforms the values of attributes. A method runs in the Thing's own frame, and `place` then transforms its return value. The
    attributes of a view are read-only.
    """

    __slots__ = ("__location", "__target")

    def __init__(self, target: object, location: Location) -> None:
        object.__setattr__(self, "_TransformResolver__target", target)
        object.__setattr__(self, "_TransformResolver__location", Location(_location(location).wrapped))

    def move(self, location: Location) -> TransformResolver:
        """Move the view by `location` in the local frame, as `Shape.moved` of build123d does. Return the new view."""
        return TransformResolver(self.__target, _location(location) * self.__location)

    def __getattr__(self, name: str) -> Any:
        """Return the attribute `name` of the Thing, expressed in the local frame. Raises `AttributeError` if the Thing does not have this
        attribute.
        """
        if name.startswith("__"):
            raise AttributeError(name)
        return place(getattr(self.__target, name), self.__location)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a moved view of {self.__target!r} is read-only: `{name}` cannot be assigned")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"a moved view of {self.__target!r} is read-only: `{name}` cannot be deleted")

    def __dir__(self) -> list[str]:
        return sorted({"move", *dir(self.__target)})

    def __repr__(self) -> str:
        return f"<{self.__target!r} moved by {self.__location!r}>"

    def _in_frame(self, view: Location) -> TransformResolver:
        return TransformResolver(self.__target, view * self.__location)


def place(value: Any, location: Location) -> Any:
    """Transform a value from a frame at `location` [mm] to the enclosing frame.

    Shapes, planes and axes are moved. Sketches, edges and vertices count as shapes. A location is composed with `location`. A vector is
    transformed as a point. A mount is moved, and it still belongs to its Thing. A bounding box is replaced by the axis-aligned bounding box
    of the moved box. Things, moved views, builders, dataclasses and namespaces become moved views. The function also transforms every item
    of a list, tuple or dict, and the return value of a callable. Any other value, such as a number, a string or a colour, is returned
    unchanged. Raises `TypeError` for a matrix, an oriented bounding box or a joint.
    """
    if isinstance(value, Shape):
        return _move_shape(value, location)
    if isinstance(value, Location):
        return location * value
    if isinstance(value, Framed):
        return value._in_frame(location)
    if isinstance(value, (Builder, types.SimpleNamespace)):
        return TransformResolver(value, location)
    if isinstance(value, Vector):
        return Vector(value.to_pnt().Transformed(location.wrapped.Transformation()).XYZ())
    if isinstance(value, Plane):
        return Plane(location * value.location)  # `Plane.moved` applies it inside the plane's own frame
    if isinstance(value, Axis):
        return value.located(location)
    if isinstance(value, BoundBox):
        assert value.wrapped is not None
        return BoundBox(value.wrapped.Transformed(location.wrapped.Transformation()))
    if isinstance(value, LocationList):
        return [location * item for item in value.locations]
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return type(value)(*(place(item, location) for item in value))
    if isinstance(value, (list, tuple, set, frozenset)):
        return type(value)(place(item, location) for item in value)
    if isinstance(value, dict):
        return {key: place(item, location) for key, item in value.items()}
    if isinstance(value, type):
        return _calling(value, location) if issubclass(value, (Framed, Shape)) else value
    if isinstance(value, (Matrix, OrientedBoundBox, Joint)):
        raise TypeError(f"a {type(value).__name__} cannot be used through a moved view: use a Location or a Shape instead")
    if isinstance(value, Actuator) or type(value).__module__.startswith("build123d."):
        return value
    if dataclasses.is_dataclass(value):
        return TransformResolver(value, location)
    if callable(value):
        return _calling(value, location)
    return value


def _calling(function: Callable[..., Any], location: Location) -> Callable[..., Any]:
    """Wrap a method, so that it runs in the frame of the Thing and `place` transforms its return value."""

    @functools.wraps(function, updated=())
    def call(*args: Any, **kwargs: Any) -> Any:
        return place(function(*args, **kwargs), location)

    return call


def _location(location: object) -> Location:
    """Convert a location or a plane to a location. Raises `TypeError` if the object is neither a location nor a plane."""
    if isinstance(location, Plane):
        location = location.location
    if not isinstance(location, Location):
        raise TypeError(f"move() expects a Location, found {location!r}")
    return location


def _move_shape(shape: Shape[Any], location: Location) -> Shape[Any]:
    """Return a moved shape that shares its geometry with `shape`. Only the location is copied.

    build123d's `moved` copies the whole topology, which takes some milliseconds for a servo. The method `moved` is only called for shapes
    that are part of an assembly tree.
    """
    if shape.parent is not None or shape.children or getattr(shape, "joints", None):
        return shape.moved(location)
    moved = shape.__class__.__new__(shape.__class__)
    for key, value in vars(shape).items():
        moved.__dict__[key] = copy.copy(value) if isinstance(value, (list, dict)) else value
    moved.wrapped = downcast(shape.wrapped.Moved(location.wrapped))
    return moved
