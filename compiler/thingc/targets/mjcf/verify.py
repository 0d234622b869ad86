"""Every model that was written is compiled by MuJoCo, and what it says against one is shown where the cause was written.

MuJoCo is only imported when there is a model that it has not accepted before.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Note, Report, Severity
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo
from thingc.base.source import Origin
from thingc.geometry.store.local import Store
from thingc.model.robot.types import Robot
from thingc.targets.geometry import Geometry, MeshAsset
from thingc.targets.mjcf import elements, initial_state_checks
from thingc.targets.mjcf.accepted_models import AcceptedModels, about_meshes, box_bytes, mesh_bytes, mujoco_version
from thingc.targets.xml_writer import Element, RawValue, XmlText, write

MANY = 20_000_000
"""Bytes of meshes that MuJoCo is given at once; it takes some fifteen times as many for them."""


class Candidate(FrozenStruct):
    """A mode's files: `model` as it was written from the element `root` with `heading`, and the scene that includes it as
    `file`."""

    mode: str
    file: str
    root: Element
    heading: str
    model: XmlText
    scene: XmlText
    origin: Origin
    robot: Robot

    @property
    def texts(self) -> tuple[str, str]:
        """Both files."""
        return self.model.text, self.scene.text


class CompileResult(FrozenStruct):
    """What MuJoCo said of one text: why it refuses it (None: it compiled), its warnings, and the compiled `MjModel`."""

    error: str | None
    warnings: tuple[str, ...] = ()
    model: Any = None


def check(candidates: Sequence[Candidate], geometry: Geometry, store: Store, report: Report, memo: Memo, *, starts: bool = True) -> None:
    """Compile every candidate's scene, and with it the model in it; errors and warnings go to `report` at their origin. With `starts`
    the first instant of each is looked at, too (`initial_state_checks.py`); of several that start alike, that of the first.

    Models that MuJoCo has accepted before are not compiled again (`accepted_models.py`): nor is one of several that start alike where the
    first of them is accepted, and what it has of its own (names, limits, colours, gravity) was when it was compiled last in this session.
    """
    known = AcceptedModels(store, mujoco_version(), geometry.meshes)
    waiting = [candidate for candidate in candidates if not known.model(candidate.texts, started=starts)]
    alike: dict[str, Candidate] = {}
    leaders: dict[str, Candidate] = {}  # whose first instant is looked at, by mode; of the other modes it was in order before
    for one in waiting if starts else ():
        key = initial_state_checks.key(one.model.text, one.robot)
        if key in alike or not known.start(key):
            leaders[one.mode] = alike.setdefault(key, one)
    begun: dict[str, initial_state_checks.InitialState] = {}
    settled: set[str] = set()
    touching = {shape.mesh for one in geometry.shapes for shape in one.collision if shape.mesh is not None}
    whole = any(about_meshes(one.root) for one in waiting)
    instead = [] if whole or not waiting else _one_by_one(known, touching if alike else ())
    looked = {one.mode for one in alike.values()}
    for candidate, verdict, files in _verdicts(waiting, known, looked, touching, settled, instead):
        if verdict.error is not None:
            _explain(candidate, files, report, scene_error=verdict.error)
            continue
        leader = leaders.get(candidate.mode)
        if leader is candidate:
            begun[candidate.mode] = initial_state_checks.look(verdict.model, candidate.robot)
            if begun[candidate.mode].in_order:
                known.accept_start(initial_state_checks.key(candidate.model.text, candidate.robot))
        elif leader is not None and leader.mode in begun:
            begun[candidate.mode] = replace(begun[leader.mode], robot=candidate.robot)
        if not verdict.warnings and (leader is None or candidate.mode in begun and begun[candidate.mode].in_order):
            known.accept(candidate.texts, started=starts)
            memo.keep(*_own(candidate), True)
            followers = [one for one in waiting if leader is candidate and leaders.get(one.mode) is candidate]
            settled.update(one.mode for one in followers if memo.last(*_own(one)))
        for warning in verdict.warnings:
            _say(Code.MJCF_WARNING, "warns of", warning, candidate, candidate.model, report, severity=Severity.WARNING)
    initial_state_checks.say([begun[one.mode] for one in waiting if one.mode in begun], report)


def _verdicts(
    candidates: Sequence[Candidate], known: AcceptedModels, looked: Collection[str], touching: Collection[str], settled: Collection[str],
    instead: Sequence[Mapping[str, bytes]],
) -> Iterator[tuple[Candidate, CompileResult, Any]]:
    """What MuJoCo says of each scene, which holds all that the model in it does, and the files that it has read. Modes that are `looked` at
    need the true meshes of what is `touching`, and come first; of the others those that are `settled` by then are left out. As long as
    nothing is said, what stands `instead` of the true meshes will do (see `_one_by_one`). One after the other, for it keeps what it reads
    among the files, so that two at once are given each other's models, or end the process. It keeps the meshes of the first, too, and needs
    threads for these alone; and the textures, which are the same in all scenes, it need not paint again."""
    first, standing = True, [*instead, {}]
    for true in (touching, ()):
        batch = [one for one in candidates if (one.mode in looked) is (true is touching) and one.mode not in settled]
        if not batch:
            continue
        files = in_memory(known.data([one.root for one in batch], true, standing[0]))
        for candidate in batch:
            model, scene = candidate.model.text, candidate.scene.text
            files[candidate.file] = (model if first else _without_threads(model)).encode()
            verdict = attempt(scene if first else _unpainted(scene), files)
            while len(standing) > 1 and not _will_do(verdict, candidate.robot, boxes=len(standing) > 2):
                del standing[0]
                files = in_memory(known.data([one.root for one in batch], true, standing[0]))
                files[candidate.file] = model.encode()
                verdict = attempt(scene, files)
            yield candidate, verdict, files
            first = False


def _will_do(verdict: CompileResult, robot: Robot, *, boxes: bool) -> bool:
    """Whether nothing is said of a scene that has others in the place of its meshes; if these are boxes, nothing may be in another."""
    return verdict.error is None and not verdict.warnings and not (boxes and initial_state_checks.look(verdict.model, robot).inside)


def _one_by_one(known: AcceptedModels, touching: Collection[str]) -> list[Mapping[str, bytes]]:
    """Where meshes are too many for once, have MuJoCo take each by itself; and what may stand for those of `touching` (names of meshes), by
    file: boxes around them, of which those that are not in each other hold nothing that is, then the convex hulls that MuJoCo touches. What
    anything is said against is left to be read with the model."""
    waiting = known.unread(touching)
    if sum(mesh.stored.size for mesh in waiting) <= MANY:
        return []
    import mujoco

    boxes: dict[str, bytes] = {}
    hulls: dict[str, bytes] = {}
    for mesh in waiting:
        felt = mesh.name in touching
        root = Element(tag="mujoco")
        root.add("asset").children += elements.meshes((mesh,))
        root.add("worldbody").add("geom", {"type": "mesh", "mesh": mesh.name, **({} if felt else {"contype": "0", "conaffinity": "0"})})
        verdict = attempt(write(root, "").text, in_memory({mesh.file: known.store.read(mesh.stored.sha256)}))
        mujoco.mj_clearCache(mujoco.mj_getCache())
        if verdict.error is None and not verdict.warnings:
            known.accept_mesh(mesh)
            if felt:
                corners, sides = _hull(verdict.model, mesh)
                boxes[mesh.file], hulls[mesh.file] = box_bytes(mesh.file, corners), mesh_bytes(mesh.file, corners, sides)
    return [boxes, hulls]


def _hull(model: Any, mesh: MeshAsset) -> tuple[list[list[float]], list[list[int]]]:
    """Corners, in the numbers of its file, and triangles of the convex hull of the one mesh of a model (`mjModel.mesh_graph`)."""
    import mujoco
    import numpy as np

    graph = np.asarray(model.mesh_graph)
    count, sides = int(graph[0]), int(graph[1])
    corners, faces = graph[2 + count : 2 + 2 * count], graph[2 + 3 * count + 3 * sides : 2 + 3 * count + 6 * sides]
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.mesh_quat[0])
    scale = 1.0 if mesh.own is None or mesh.scale is None else mesh.scale
    points = (model.mesh_vert[corners] @ turn.reshape(3, 3).T + model.mesh_pos[0]) / scale
    place = {int(corner): number for number, corner in enumerate(corners)}
    return points.tolist(), [[place[int(corner)] for corner in side] for side in faces.reshape(-1, 3)]


_NUMBERS = re.compile(r'(?<=[" ])-?[0-9][0-9.e+-]*(?=[" ])')
"""Numbers in attributes."""


def due(candidates: Sequence[Candidate], share: int, memo: Memo) -> list[Candidate]:
    """Those of the models that are given to MuJoCo where of so many (`share`) that differ in nothing but numbers one is: the first of each
    kind that it has not taken yet, and every so many after it."""
    if share <= 1:
        return list(candidates)
    asked = []
    for candidate in candidates:
        place = _kind(candidate)
        taken: int | None = memo.last(place, ())
        if taken is None or taken % share == 0:
            asked.append(candidate)
        if taken is not None:
            memo.keep(place, (), taken + 1)
    return asked


def took(candidates: Sequence[Candidate], share: int, memo: Memo) -> None:
    """Note that MuJoCo has taken these without a word."""
    for candidate in candidates if share > 1 else ():
        place = _kind(candidate)
        if memo.last(place, ()) is None:
            memo.keep(place, (), 1)


def _kind(candidate: Candidate) -> tuple[str, str, str]:
    """Of what kind a model is: its text without numbers."""
    return ("mujoco takes", candidate.mode, hashlib.sha256(_NUMBERS.sub("", candidate.model.text).encode()).hexdigest())


def doubtful(candidates: Sequence[Candidate], meshes: Sequence[MeshAsset], store: Store, memo: Memo, *, starts: bool) -> list[Candidate]:
    """Those of the models that `check` has to look at: of the others MuJoCo takes them without a word, which is found out quickly, for the
    many models of a session.

    Only where it has taken the same scene before, but for its numbers, and with `starts` looked at the same first instant. A model is
    compiled by itself, with tetrahedra in the place of the meshes that MuJoCo has taken before; where anything is said against it, `check`
    has to find out what and why.
    """
    known = [one for one in candidates if memo.last(*_scene(one)) is not None]
    accepted = AcceptedModels(store, mujoco_version(), meshes)
    if starts and known:
        known = [one for one in known if accepted.start(initial_state_checks.key(one.model.text, one.robot))]
    known = [one for one in known if not about_meshes(one.root)]
    if not known:
        return list(candidates)
    files = memo("mujoco files", lambda _: in_memory(accepted.data(())), tuple(meshes))
    sound = set()
    for one in known:
        verdict = attempt(_without_threads(one.model.text), files)
        if verdict.error is None and not verdict.warnings:
            sound.add(one.mode)
    if len(sound) == len(known):
        accepted.accept_meshes()
    return [one for one in candidates if one.mode not in sound]


def took_scenes(candidates: Sequence[Candidate], memo: Memo) -> None:
    """Note that MuJoCo has taken the scenes of these without a word."""
    for candidate in candidates:
        memo.keep(*_scene(candidate), True)


def _own(candidate: Candidate) -> tuple[tuple[str, str], tuple[str, tuple[str, ...]]]:
    """Where it is noted that MuJoCo has taken what a mode has of its own, and what that is: its scene without numbers, and what of its
    model `start.key` leaves out."""
    return ("mujoco own", candidate.mode), (_NUMBERS.sub("", candidate.scene.text), initial_state_checks.apart(candidate.model.text))


def _scene(candidate: Candidate) -> tuple[tuple[str, str], tuple[str]]:
    """Where it is noted that a scene was taken, and what that holds for: its text without numbers."""
    return ("mujoco scene", candidate.mode), (_NUMBERS.sub("", candidate.scene.text),)


def in_memory(data: Mapping[str, bytes]) -> Any:
    """Files for MuJoCo, by name (an `mujoco.MjVfs`)."""
    import mujoco

    files = mujoco.MjVfs()
    for name, content in data.items():
        files[name] = content
    return files


def _without_threads(text: str) -> str:
    """A model that reads its meshes one after the other: threads take longer where MuJoCo has read them already, or each is a
    tetrahedron."""
    return text if " usethread=" in text else text.replace("<compiler ", '<compiler usethread="false" ', 1)


def _unpainted(scene: str) -> str:
    """A scene whose textures are the smallest that there are: a sky is six squares, one above the other."""
    return re.sub(r'(<texture [^>]*) width="\d+" height="\d+"', r'\1 width="1" height="6"', scene)


def attempt(text: str, files: Any) -> CompileResult:
    """Compile one text, with the files that it names (see `in_memory`)."""
    import mujoco

    with heard() as warnings:
        try:
            model, error = mujoco.MjModel.from_xml_string(text, vfs=files), None
        except (ValueError, mujoco.FatalError) as fault:
            model, error = None, str(fault)
    return CompileResult(error=error, warnings=tuple(warnings), model=model)


@contextmanager
def heard() -> Iterator[list[str]]:
    """MuJoCo's warnings. Left alone it prints them and writes `MUJOCO_LOG.TXT` into the working folder."""
    import mujoco

    heard: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(heard.append)
    try:
        yield heard
    finally:
        mujoco.set_mju_user_warning(before)


def _explain(candidate: Candidate, files: Any, report: Report, *, scene_error: str) -> None:
    """Report why a model is refused: every raw attribute that is to blame, and one cause beyond them.

    MuJoCo stops at its first error, so a raw attribute that is to blame is lifted and the rest tried again.
    """
    written = candidate.model
    while True:
        error = attempt(written.text, files).error
        if error is None:
            break
        place = _element_at(error, written)
        blamed = _blame(error, place, candidate, files)
        if blamed is None:
            _say(Code.MJCF_REFUSED, "refuses", error, candidate, written, report)
            return
        owner, name, value = blamed
        report.add(
            Code.MJCF_REFUSED,
            f"MuJoCo refuses `{name}` of {owner.label}: {_words(error)}",
            value.attribute.origin,
            path=".".join(("raw", value.attribute.target, *value.attribute.path)),
            help="see the XML reference of MuJoCo for the attributes and values it takes",
            notes=[Note(message=f"{owner.label} comes from here", span=owner.origin[0])] if _of_document(owner) else (),
        )
        written = write(candidate.root, candidate.heading)
    if written is candidate.model:
        message = f"MuJoCo refuses the scene of mode `{candidate.mode}`: {_words(scene_error)}"
        report.add(Code.MJCF_REFUSED, message, candidate.origin, path=candidate.mode)


def _of_document(element: Element) -> bool:
    """Whether something that a document names made this element (an `option` is everybody's)."""
    return bool(element.origin) and "name" in element.attributes


def _blame(error: str, place: Element | None, candidate: Candidate, files: Any) -> tuple[Element, str, RawValue] | None:
    """The raw attribute that an error comes from, lifted, or None when all of them are innocent.

    Tried in turn: one of the element that the error names, by name; then each one of that element; then each one of the
    model. Whichever changes what MuJoCo says when it is taken away is to blame.
    """
    quoted = set(re.findall(r"[A-Za-z_]\w*", error))
    owned = [(place, name) for name in place.raw] if place is not None else []
    others = [(element, name) for element in candidate.root.walk() if element is not place for name in element.raw]
    for element, name in (*sorted(owned, key=lambda pair: pair[1] not in quoted), *others):
        value = element.lift(name)
        if attempt(write(candidate.root, candidate.heading).text, files).error != error:
            return element, name, value
        element.lay(name, value.attribute)
    return None


def _say(
    code: Code, verb: str, text: str, candidate: Candidate, written: XmlText, report: Report, *,
    severity: Severity = Severity.ERROR,
) -> None:
    """Report what MuJoCo said at the origin of the element it said it of, or of the raw attribute that it names."""
    place = _element_at(text, written)
    for element in (place,) if place is not None else candidate.root.walk():
        for name, value in element.raw.items():
            if f"'{name}'" in text:
                message = f"MuJoCo {verb} `{name}` of {element.label}: {_words(text)}"
                path = ".".join(("raw", value.attribute.target, *value.attribute.path))
                report.add(code, message, value.attribute.origin, path=path, severity=severity)
                return
    subject = "the model" if place is None or place.tag == "mujoco" else place.label
    origin = place.origin if place is not None and place.origin else candidate.origin
    name_of = (place.get("name") or None) if place is not None else None
    report.add(code, f"MuJoCo {verb} {subject}: {_words(text)}", origin, path=name_of, severity=severity)


def _element_at(text: str, written: XmlText) -> Element | None:
    """The element that MuJoCo speaks of: by line, else by its name in the text."""
    line = re.search(r"\bline (?:number=)?(\d+)", text, re.IGNORECASE)
    if line:
        return written.element_at(int(line[1]))
    name = re.search(r"Element name '([^']+)'", text) or re.search(r"'([^']+)'", text)
    if name is None:
        return None
    named = [element for element in written.lines if element is not None and element.get("name") == name[1]]
    word = re.search(r"\b(keyframe|mesh|material|joint|geom|site|body|actuator)\b", text)
    tag = {"keyframe": "key"}.get(word[1], word[1]) if word else None
    return next((element for element in named if element.tag == tag), named[0] if named else None)


def _words(text: str) -> str:
    """MuJoCo's words without what only makes sense beside the XML."""
    parser = re.search(r"Error=(XML_\w+)", text)
    if parser is not None:
        deep = " (it reads 500 levels: a chain of links is too long)" if parser[1] == "XML_ELEMENT_DEPTH_EXCEEDED" else ""
        return f"its XML reader says {parser[1]}{deep}"
    first = next((line for line in text.splitlines() if line.strip()), "no reason given")
    return re.sub(r"^(?:(?:XML )?Error: |Schema violation: |error )+", "", first.strip()).rstrip(".")
