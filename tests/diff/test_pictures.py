"""Pictures of changes, and the HTML page that shows them."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import mujoco
import pytest

from diff.cranes import write
from thingc.tools.diff.comparison import Comparison
from thingc.tools.diff.pictures import GONE, MOVED, NEW, OTHER, SAME, colours, set_colours, with_removed
from thingc.tools.diff.results import DiffResult
from thingc.tools.diff.snapshot import Change
from thingc.tools.diff.text_report import as_html, as_markdown

CHANGES = (
    Change(what="component", change="added", path="lamp", new="lamps:Lamp"),
    Change(what="geometry", change="changed", path="arm", new_path="boom", field="volume", old=1e-6, new=2e-6, because=("reach",)),
    Change(what="component", change="moved", path="hook", field="place", old=(0.0, 0.0, 0.0), new=(0.0, 0.0, 0.1), because=("reach",)),
    Change(what="component", change="moved", path="arm", new_path="boom", field="place", old=(0.0,) * 3, new=(0.1,) * 3),
    Change(what="component", change="renamed", path="arm", new_path="boom", reason="the same <definition>"),
)
PICTURES = {"before": b"\x89PNG before", "after": b"\x89PNG after", "overlay": b"\x89PNG overlay"}


def test_parts_are_coloured_by_their_change() -> None:
    assert colours(CHANGES) == {"lamp": NEW, "boom": OTHER, "hook": MOVED}
    geoms = [f'<geom class="visual" name="{name}"/>' for name in ("lamp", "boom", "hook", "mast")]
    xml = set_colours(f'<mujoco><worldbody>{"".join(geoms)}<geom name="boom:collision"/></worldbody></mujoco>', colours(CHANGES))
    assert re.findall(r'name="([\w:]+)"(?: rgba="([^"]+)")?', xml) == [
        ("lamp", NEW), ("boom", OTHER), ("hook", MOVED), ("mast", SAME), ("boom:collision", ""),
    ]


def test_removed_parts_are_shown_at_their_old_pose() -> None:
    """In the pose of the first keyframe, with its mesh, and without changing the new robot."""
    corners = "0 0 0  .1 0 0  0 .1 0  0 0 .1"
    meshes = f'<mesh name="m" file="m.obj"/><mesh name="n" vertex="{corners}"/>'
    head = f'<mujoco><default><default class="visual"/></default><asset>{meshes}</asset><worldbody>'
    hand = '<body name="hand" pos=".2 0 0"><geom class="visual" name="hand/cap" type="mesh" mesh="m" pos="0 0 .1"/></body>'
    arm = '<body name="arm" pos="0 0 1"><joint axis="0 1 0"/><geom class="visual" name="arm" type="mesh" mesh="n"/>{}</body></worldbody>'
    tail = '<keyframe><key name="home" qpos="1.2"/></keyframe></mujoco>'
    old, new = (head + arm.format(inside) + tail for inside in (hand, ""))
    assets = {"m.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"}
    change = Change(what="component", change="removed", path="hand", old="hand.yaml")
    models = [mujoco.MjModel.from_xml_string(*one) for one in (with_removed((new, assets), (old, assets), [change]), (old, assets))]
    places = []
    for model in models:
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_kinematics(model, data)
        (geom,) = [k for k in range(model.ngeom) if model.geom(k).name != "arm"]
        places.append((*data.geom_xpos[geom], *data.geom_xmat[geom]))
    assert places[0] == pytest.approx(places[1], abs=1e-12)
    assert models[0].nq == models[1].nq and [float(x) for x in GONE.split()] == pytest.approx(models[0].geom_rgba[-1].tolist())
    assert with_removed((new, assets), (old, assets), CHANGES) == (new, assets)


def test_html_page_has_pictures_and_a_slider() -> None:
    fails = Change(what="test", change="changed", path="light", field="passed", old=True, new=False, because=("hook",))
    comparison = Comparison(name="crane", changes=(*CHANGES, fails), pictures=PICTURES)
    page = as_html(DiffResult(old="main", new="<HEAD>", documents=(("crane.yaml", comparison),)))
    assert "<h1>main → &lt;HEAD&gt;</h1>" in page and "the same &lt;definition&gt;" in page
    assert page.count('src="data:image/png;base64,') == 3 and page.count('<input type="range"') == 1
    assert "http" not in page.replace("https", "http").partition("<body>")[2]
    assert page.index("<code>light</code>: FAILS now") < page.index("<details")  # not folded away
    assert "<summary>geometry (1)</summary>" in page and page.count("<details") == page.count("</details>")


def test_markdown_refers_to_pictures() -> None:
    comparison = Comparison(name="crane", changes=CHANGES, pictures=PICTURES)
    differences = DiffResult(old="main", new="HEAD", documents=(("cr[ane].yaml", comparison),))
    text = as_markdown(differences, lambda name, key: f"pictures/crane_{key}.png")
    assert "![cr?ane?.yaml, before](pictures/crane_before.png)\n![cr?ane?.yaml, after](pictures/crane_after.png)\n" in text
    assert "![" not in as_markdown(differences)


def test_markdown_length_is_limited() -> None:
    changes = tuple(
        Change(what="component", change="renamed", path=f"part_{k}", new_path=f"piece_{k}", reason="`the same` definition" * 3)
        for k in range(3000)
    )
    text = as_markdown(DiffResult(old="main", new="HEAD", documents=(("crane.yaml", Comparison(name="crane", changes=changes)),)))
    assert 5_000 < len(text.encode()) <= 60_000 and "- and 2800 more\n" in text


def test_html_page_is_written(tmp_path: Path, shared_store: str) -> None:
    """In a separate process, because MuJoCo selects its renderer at import. A robot without geometry has no pictures."""
    words = [str(write(tmp_path / "old")), str(write(tmp_path / "new", ("value: 120 g", "value: 150 g")))]
    done = subprocess.run(
        [sys.executable, "-m", "thingc", "diff", *words, "--no-tests", "--store", shared_store, "--html", "change.html"],
        cwd=tmp_path, capture_output=True, text=True,
    )
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "change.html").read_text()
    assert "mass.value 120 g -&gt; 150 g (+25 %)" in page and "<img" not in page
    done = subprocess.run(
        [sys.executable, "-m", "thingc", "diff", *words, "--no-tests", "--store", shared_store, "--html", "no/change.html"],
        cwd=tmp_path, capture_output=True, text=True,
    )
    assert done.returncode == 2 and "cannot write `no/change.html`: no such file or directory" in done.stderr
