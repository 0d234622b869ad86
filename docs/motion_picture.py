"""Draw `docs/pictures/drive_margin.svg`: torque over speed of the drive in `docs/howto/check_a_motion.md`, and its torque-speed line."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Sequence
from pathlib import Path

from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.driver.testing.kinds.drive_margin import Instant, instants

DOCS = Path(__file__).resolve().parent
PAGE, PICTURE = DOCS / "howto" / "check_a_motion.md", DOCS / "pictures" / "drive_margin.svg"
WIDTH, HEIGHT, EDGE = 560.0, 300.0, 44.0
EFFORT, SPEED = 0.6, 6.0
"""The largest torque [N m] and speed [rad/s] of the drive on the page."""


def measured() -> list[Instant]:
    """Return the instants of the motion on the page."""
    text = re.search(r"```yaml\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert text is not None
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "thingc.toml").write_text('thingc = "workspace/1"\n')
        document = Path(folder, "waver.yaml")
        document.write_text(text[1])
        with Environment(str(document), Options(store=folder)) as environment:
            robot = pipeline.compile(environment).robots[0]
            return list(instants(robot, robot.assembly.definition.motions[0], None))


def at(speed: float, effort: float) -> str:
    """Return the coordinates of a speed and a torque on the page."""
    x = WIDTH / 2 + speed / SPEED * (WIDTH / 2 - EDGE)
    return f"{x:.1f},{HEIGHT / 2 - effort / EFFORT * (HEIGHT / 2 - EDGE / 2):.1f}"


def line(points: Sequence[str], style: str) -> str:
    """Return a polyline."""
    return f'<polyline points="{" ".join(points)}" fill="none" {style}/>'


def picture() -> str:
    """Return the picture as SVG."""
    found = measured()
    worst = min(found, key=lambda one: one.margin)
    x, y = at(worst.speed, worst.effort).split(",")
    limits = [[at(-SPEED, EFFORT), at(0, EFFORT), at(SPEED, 0)], [at(-SPEED, 0), at(0, -EFFORT), at(SPEED, -EFFORT)]]
    grey = 'stroke="#888"'
    return "\n".join([
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" font-family="sans-serif" font-size="13" fill="#555">',
        f'<rect width="{WIDTH:g}" height="{HEIGHT:g}" fill="#fff"/>',
        line([at(-SPEED, 0), at(SPEED, 0)], grey), line([at(0, -EFFORT), at(0, EFFORT)], grey),
        *(line(points, 'stroke="#c62828" stroke-width="2" stroke-dasharray="6 4"') for points in limits),
        line([at(one.speed, one.effort) for one in found], 'stroke="#1565c0" stroke-width="2.5"'),
        f'<circle cx="{x}" cy="{y}" r="5" fill="#c62828"/>',
        f'<text x="{float(x) - 8:.1f}" y="{float(y) - 14:.1f}" text-anchor="end">margin {worst.margin:.2f} at {worst.time:.2f} s</text>',
        f'<text x="{WIDTH - EDGE - 62:g}" y="{HEIGHT / 2 + 18:g}">speed 6 rad/s</text>',
        f'<text x="{WIDTH / 2 - 8:g}" y="{EDGE / 2 + 18:g}" text-anchor="end">torque 0.6 N m</text>', "</svg>", "",
    ])


if __name__ == "__main__":
    PICTURE.write_text(picture(), encoding="utf-8", newline="\n")
