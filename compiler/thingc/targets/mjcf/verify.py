"""Compile every model with MuJoCo, and report the messages of MuJoCo at their causes in the documents.

MuJoCo is only imported if a model was not accepted before.
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
"""Maximum total size of the meshes that MuJoCo reads in one compilation [bytes]. MuJoCo needs about fifteen times as much memory as this
size.
"""


class Candidate(FrozenStruct):
    """The MJCF files of a mode, before MuJoCo has checked them.

    `model` is the XML text of the element `root`, with the comment `heading`. The scene includes the model under the file name `file`.
    """

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
        """Return the contents of the model file and of the scene file."""
        return self.model.text, self.scene.text


class CompileResult(FrozenStruct):
    """The result of compiling a file. The result contains the error (None on success), the warnings, and the compiled `MjModel`."""

    error: str | None
    warnings: tuple[str, ...] = ()
    model: Any = None


def check(candidates: Sequence[Candidate], geometry: Geometry, store: Store, report: Report, memo: Memo, *, starts: bool = True) -> None:
    """Compile the scene of every candidate, which includes its model. Report errors and warnings at the locations in the documents that
    cause them.

    If `starts` is True, each distinct initial state is also checked (see `initial_state_checks.py`).

    Models that MuJoCo accepted before are not compiled again (see `accepted_models.py`). A model is also not compiled again if two
    conditions are both met. Its initial state is that of an accepted model, and this process has accepted its other contents (names,
    limits, colours, gravity).
    """
    known = AcceptedModels(store, mujoco_version(), geometry.meshes)
    waiting = [candidate for candidate in candidates if not known.model(candidate.texts, started=starts)]
    alike: dict[str, Candidate] = {}
    leaders: dict[str, Candidate] = {}  # by mode: the candidate whose initial state is checked; other modes were accepted before
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
    """Compile each scene with MuJoCo, and yield the results and the files that MuJoCo read.

    The modes in `looked` come first. The scenes of these modes need the true meshes whose names are in `touching`. Any other mode is
    omitted if `settled` already contains it. The meshes in `instead` are used until MuJoCo reports a message (see `_one_by_one`). The
    scenes are compiled one after the other, because MuJoCo caches files by name. If several scenes were compiled in parallel, a scene could
    get the model of another scene, or the process could crash. MuJoCo also caches the meshes of the first scene. Therefore, only the first
    compilation needs threads. The textures are the same in all scenes, so only the first scene generates textures.
    """
    first, standing = True, [*instead, {}]
    for true in (touching, ()):
        batch = [one for one in candidates if (one.mode in looked) is (true is touching) and one.mode not in settled]
        if not batch:
            continue
        files = in_memory(known.data([one.root for one in batch], true, standing[0]))
        for candidate in batch:
            model, scene = candidate.model.text, candidate.scene.text
            files[candidate.file] = (model if first else _without_threads(model)).encode()
            verdict = attempt(scene if first else _shrink_textures(scene), files)
            while len(standing) > 1 and not _will_do(verdict, candidate.robot, boxes=len(standing) > 2):
                del standing[0]
                files = in_memory(known.data([one.root for one in batch], true, standing[0]))
                files[candidate.file] = model.encode()
                verdict = attempt(scene, files)
            yield candidate, verdict, files
            first = False


def _will_do(verdict: CompileResult, robot: Robot, *, boxes: bool) -> bool:
    """Return whether a scene compiles without messages after its meshes were replaced.

    If the meshes were replaced by bounding boxes, the parts must not overlap.
    """
    return verdict.error is None and not verdict.warnings and not (boxes and initial_state_checks.look(verdict.model, robot).inside)


def _one_by_one(known: AcceptedModels, touching: Collection[str]) -> list[Mapping[str, bytes]]:
    """If the meshes together are too large for one compilation, compile each mesh separately. Otherwise, return an empty list.

    Return two mappings from file names to replacements for the meshes in `touching` (names of meshes). The first mapping contains bounding
    boxes. Two bounding boxes overlap if their meshes overlap. The second mapping contains the convex hulls that MuJoCo uses for contacts. A
    mesh for which MuJoCo reports a message is not replaced.
    """
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
            known.accept_meshes(mesh)
            if felt:
                corners, sides = _hull(verdict.model, mesh)
                boxes[mesh.file], hulls[mesh.file] = box_bytes(mesh.file, corners), mesh_bytes(mesh.file, corners, sides)
    return [boxes, hulls]


def _hull(model: Any, mesh: MeshAsset) -> tuple[list[list[float]], list[list[int]]]:
    """Return the convex hull of the only mesh of a model (see `mjModel.mesh_graph`). The result consists of corners in the unit of the file
    and of triangles.
    """
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
"""Pattern that matches numbers in the values of attributes."""


def due(candidates: Sequence[Candidate], share: int, memo: Memo) -> list[Candidate]:
    """Return the models to compile. The selected models are one out of every `share` models that differ only in numbers.

    The selected models include the first model of each kind, and every `share`-th later model of this kind.
    """
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
    """Record that MuJoCo accepted the scenes of these models without errors and warnings, for the functions `doubtful` and `due`."""
    for candidate in candidates:
        memo.keep(*_scene(candidate), True)
        if share > 1 and memo.last(_kind(candidate), ()) is None:
            memo.keep(_kind(candidate), (), 1)


def _kind(candidate: Candidate) -> tuple[str, str, str]:
    """Return a key for a model, which is its XML text without numbers. Models that differ only in numbers have the same key."""
    return ("mujoco takes", candidate.mode, hashlib.sha256(_NUMBERS.sub("", candidate.model.text).encode()).hexdigest())


def doubtful(candidates: Sequence[Candidate], meshes: Sequence[MeshAsset], store: Store, memo: Memo, *, starts: bool) -> list[Candidate]:
    """Return the models that the function `check` must compile. All other models were accepted by a faster check.

    The faster check is possible if MuJoCo has accepted a scene that differs only in numbers. If `starts` is True, the initial state must
    also be the same. This check compiles the model without its scene. Tetrahedra replace the meshes that MuJoCo has accepted. If MuJoCo
    reports messages, the model is returned, so that `check` can find their cause.
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


def _own(candidate: Candidate) -> tuple[tuple[str, str], tuple[str, tuple[str, ...]]]:
    """Return a key and a value of `Memo` for the contents of a mode that do not affect the initial state of a simulation.

    These contents are the scene without numbers, and the parts of the model that `initial_state_checks.key` omits.
    """
    return ("mujoco own", candidate.mode), (
        _NUMBERS.sub("", candidate.scene.text), initial_state_checks.irrelevant_parts(candidate.model.text),
    )


def _scene(candidate: Candidate) -> tuple[tuple[str, str], tuple[str]]:
    """Return a key and a value of `Memo` for a scene that was accepted. The key contains the XML text of the scene without numbers."""
    return ("mujoco scene", candidate.mode), (_NUMBERS.sub("", candidate.scene.text),)


def in_memory(data: Mapping[str, bytes]) -> Any:
    """Return a virtual file system (`mujoco.MjVfs`) that contains the given files by name."""
    import mujoco

    files = mujoco.MjVfs()
    for name, content in data.items():
        files[name] = content
    return files


def _without_threads(text: str) -> str:
    """Change the XML text of a model so that MuJoCo compiles the model without threads.

    Without threads, compilation is faster if the meshes are cached or are tetrahedra.
    """
    return text if " usethread=" in text else text.replace("<compiler ", '<compiler usethread="false" ', 1)


def _shrink_textures(scene: str) -> str:
    """Return a scene in which all textures have the smallest possible size. The texture of a sky consists of six squares, one below the
    other.
    """
    return re.sub(r'(<texture [^>]*) width="\d+" height="\d+"', r'\1 width="1" height="6"', scene)


def attempt(text: str, files: Any) -> CompileResult:
    """Compile an MJCF file with MuJoCo, and return the errors, the warnings and the model.

    `files` contains all files to which the model refers (see `in_memory`).
    """
    import mujoco

    with heard() as warnings:
        try:
            model, error = mujoco.MjModel.from_xml_string(text, vfs=files), None
        except (ValueError, mujoco.FatalError) as fault:
            model, error = None, str(fault)
    return CompileResult(error=error, warnings=tuple(warnings), model=model)


@contextmanager
def heard() -> Iterator[list[str]]:
    """Return a context manager that collects the warnings of MuJoCo in a list.

    By default, MuJoCo prints warnings and writes them to `MUJOCO_LOG.TXT` in the working folder.
    """
    import mujoco

    heard: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(heard.append)
    try:
        yield heard
    finally:
        mujoco.set_mju_user_warning(before)


def _explain(candidate: Candidate, files: Any, report: Report, *, scene_error: str) -> None:
    """Report the causes for which MuJoCo rejects a model. All raw attributes that cause an error are reported, and at most one other cause.

    MuJoCo stops at the first error in a model. Therefore, the raw attribute that causes an error is removed, and the model is compiled
    again.
    """
    written = candidate.model
    while True:
        error = attempt(written.text, files).error
        if error is None:
            break
        place = _element_at(error, written)
        blamed = _blame(error, place, candidate, files)
        if blamed is None:
            _say(Code.MJCF_REFUSED, "rejects", error, candidate, written, report)
            return
        owner, name, value = blamed
        named = bool(owner.origin) and "name" in owner.attributes  # an `option`, for example, comes from several items of the document
        report.add(
            Code.MJCF_REFUSED, f"MuJoCo rejects `{name}` of {owner.label}: {_words(error)}", value.attribute.origin,
            path=".".join(("raw", value.attribute.target, *value.attribute.path)),
            help="see the XML reference of MuJoCo for valid attributes and values",
            notes=[Note(message=f"{owner.label} is defined here", span=owner.origin[0])] if named else (),
        )
        written = write(candidate.root, candidate.heading)
    if written is candidate.model:
        message = f"MuJoCo rejects the scene of mode `{candidate.mode}`: {_words(scene_error)}"
        report.add(Code.MJCF_REFUSED, message, candidate.origin, path=candidate.mode)


def _blame(error: str, place: Element | None, candidate: Candidate, files: Any) -> tuple[Element, str, RawValue] | None:
    """Find the raw attribute that causes an error, remove it from the model, and return it. Return None if no raw attribute causes the
    error.

    An attribute is the cause if its removal changes the error. The attributes of the element in the error message are tried first,
    beginning with attributes that the message names. All other attributes of the model are tried afterwards.
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
    """Report a message of MuJoCo at a location in the documents.

    The location is the origin of the element that the message concerns, or of the raw attribute that the message names.
    """
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
    """Return the element to which a message of MuJoCo refers. The element is found by its line number, or else by its name. Return None if
    the message does not refer to an element.
    """
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
    """Return a message of MuJoCo without the parts that are only useful to a reader of the XML file."""
    parser = re.search(r"Error=(XML_\w+)", text)
    if parser is not None:
        deep = " (it supports 500 levels: a chain of links is too long)" if parser[1] == "XML_ELEMENT_DEPTH_EXCEEDED" else ""
        return f"its XML parser reports {parser[1]}{deep}"
    first = next((line for line in text.splitlines() if line.strip()), "no reason given")
    return re.sub(r"^(?:(?:XML )?Error: |Schema violation: |error )+", "", first.strip()).rstrip(".")
