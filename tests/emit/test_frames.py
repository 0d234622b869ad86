"""The camera of rendered pictures, and the frames and names drawn over them, measured in pixels."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

from thingc.base.pose import NO_POSE
from thingc.targets.render.frames import arrows_of, draw_marks, frame_mark, joint_mark
from thingc.targets.render.picture import MARGIN, Shot, camera_of, extent
from thingc.targets.render.studio import Array, Camera, directions, fit_camera, upright

SIZE = (640, 480)
PAPER = (128, 128, 128)
FLOOR, WALL, CEILING = (0.0, 0.0, -9.81), (-9.81, 0.0, 0.0), (0.0, 0.0, 9.81)

MODEL = """\
<mujoco>
  <worldbody>
    <body name="a" pos="0.2 0 0.4" euler="20 30 40">
      <geom type="box" size="0.3 0.02 0.05" pos="0.3 0 0"/>
      <body name="b" pos="0 0 0.3" euler="0 70 0"><geom type="box" size="0.1 0.2 0.05"/><geom type="box" size="0.05 0.05 0.4"/></body>
    </body>
  </worldbody>
</mujoco>
"""


def boxes() -> tuple[Array, mujoco.MjData]:
    """World positions of the corners of all boxes."""
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    signs = np.array(np.meshgrid((-1, 1), (-1, 1), (-1, 1))).reshape(3, 8).T
    corners = [data.geom_xpos[k] + (signs * model.geom_size[k]) @ data.geom_xmat[k].reshape(3, 3).T for k in range(model.ngeom)]
    return np.concatenate(corners), data


def pixels(camera: Camera, points: Array) -> Array:
    """Column and row of points."""
    return (1.0 + camera.project(points) * (1.0, -1.0)) * SIZE / 2.0


def test_camera_contains_all_corners() -> None:
    """The camera computed from the extent of a model shows all corners of all boxes within the margin."""
    points, _ = boxes()
    found, gravity = extent(MODEL, {}, None)
    assert gravity == FLOOR and 4 <= len(found) < len(points)
    seen = np.abs(camera_of(np.array(found), gravity, Shot(size=SIZE)).project(points)) / (1.0 - MARGIN)
    assert 1.0 - 1e-9 < seen.max() < 1.01


def test_arrow_has_expected_widths() -> None:
    """The shaft is 2.2 px wide and the head 0.9 (4 + 2.2) px. With the white outline, these are 4.2 and 0.9 (4 + 4.2) px."""
    points, data = boxes()
    axis = joint_mark(label="", body="world", pose=NO_POSE, slides=True)
    line = arrows_of(axis, data, 0.1)[0]
    camera = camera_of(np.concatenate([points, line]), FLOOR, Shot(size=SIZE, azimuth=90.0, elevation=0.0))
    image = draw_marks(np.full((*SIZE[::-1], 3), PAPER, np.uint8), [axis], data, camera, 0.1).astype(int)
    middle = round(float(pixels(camera, line)[:, 1].mean()))
    orange = (image[..., 0] - image[..., 2] > 107).sum(axis=1)  # at least half of the colour, whose red and blue differ by 214
    inked = (np.abs(image - PAPER).max(axis=2) > 64).sum(axis=1)
    assert (orange[middle], inked[middle]) == (2, 4)
    assert orange.max() == pytest.approx(5.6, abs=1.0) and inked.max() == pytest.approx(7.4, abs=1.0)


def test_name_is_drawn_beside_its_frame() -> None:
    """A name does not cover the axes of its frame and is within 60 px of the origin."""
    points, data = boxes()
    camera = camera_of(points, FLOOR, Shot(size=SIZE))
    frame = frame_mark(label="shoulder", body="a", pose=NO_POSE)
    paper = np.full((*SIZE[::-1], 3), 255, np.uint8)
    image, axes = (draw_marks(paper, [one], data, camera, 0.1) for one in (frame, replace(frame, label="")))
    origin = pixels(camera, arrows_of(frame, data, 0.1)[0][:1])[0]
    axis = np.argwhere(np.ptp(axes.astype(int), axis=2) > 60)
    axis = axis[np.linalg.norm(axis[:, ::-1] - origin, axis=1) > 3.0]  # a thin line from the name ends at the origin
    assert len(axis) > 100 and all((image[row, column] == axes[row, column]).all() for row, column in axis)
    name = np.argwhere((image != axes).any(axis=2))[:, ::-1]
    assert len(name) > 100 and np.linalg.norm(name - origin, axis=1).max() < 60.0


@pytest.mark.parametrize("seed", range(20))
def test_fitted_camera_is_as_near_as_possible(seed: int) -> None:
    """Every point, projected independently, is within the margin, and the points touch the margin on both sides in one direction."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(30, 3)) * rng.uniform(0.01, 2, 3) + rng.normal(size=3)
    azimuth, elevation, aspect = rng.uniform(-7, 7), rng.uniform(-1.5, 1.5), rng.uniform(0.3, 3)
    axes = directions(azimuth, elevation, np.eye(3))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.cross(axes[0], axes[1]), axes[2], atol=1e-12)
    look = [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)]
    np.testing.assert_allclose(-axes[2], look, atol=1e-12)
    assert abs(axes[0][2]) < 1e-12, "the horizon is level"
    camera = fit_camera(points, axes, 0.4, aspect, 0.1)
    seen = []
    for point in points:
        x, y, back = axes @ (point - camera.position)
        seen.append((x / -back / (math.tan(0.2) * aspect), y / -back / math.tan(0.2)))
        assert -back > camera.near > 0
    low, high = np.min(seen, axis=0), np.max(seen, axis=0)
    assert (low >= -0.9 - 1e-9).all() and (high <= 0.9 + 1e-9).all()
    touched = [k for k in range(2) if abs(low[k] + 0.9) < 1e-9 and abs(high[k] - 0.9) < 1e-9]
    assert touched
    np.testing.assert_allclose(camera.project(points), seen, atol=1e-12)


@pytest.mark.parametrize(("gravity", "down"), [(FLOOR, (0, 0, -1)), (WALL, (-1, 0, 0)), (CEILING, (0, 0, 1)), ((0, 0, 0), (0, 0, -1)), (
    (3.0, -4.0, 0.0), (0.6, -0.8, 0.0))])
def test_gravity_points_down_in_the_picture(gravity: tuple[float, ...], down: tuple[float, ...]) -> None:
    """`upright` gives a frame in which gravity points down. Without gravity, down is -z."""
    frame = upright(np.array(gravity))
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)
    axes = directions(0.7, -0.3, frame)
    assert axes[0] @ down == pytest.approx(0.0, abs=1e-12) and axes[1] @ down == pytest.approx(-math.cos(0.3))
    if down[2] == 0:
        assert frame[0] @ [0, 0, -1] > 0.99, "azimuth 0 looks at the wall z = 0, from above it"
