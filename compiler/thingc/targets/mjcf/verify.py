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
from thingc.geometry.store.local import Store
from thingc.model.robot.types import Robot
from thingc.targets.geometry import Geometry, MeshAsset
from thingc.targets.mjcf import elements, initial_state_checks
from thingc.targets.mjcf.accepted_models import AcceptedModels, box_bytes, changes_meshes, mesh_bytes, mujoco_version
from thingc.targets.xml_writer import Element, RawValue, XmlText, write

MAX_MESH_BYTES = 20_000_000
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
    """Compile the scene of every candidate with MuJoCo. Report errors and warnings at the locations in the documents that cause them.

    If `starts` is True, each distinct initial state is also checked (see `initial_state_checks.py`). Models that MuJoCo accepted before are
    not compiled again (see `accepted_models.py`). A model is also not compiled if its initial state equals the state of an accepted model,
    and this process has already accepted its other contents (names, limits, colours, gravity).
    """
    accepted = AcceptedModels(store, mujoco_version(), geometry.meshes)
    pending = [candidate for candidate in candidates if not accepted.model(candidate.texts, started=starts)]
    representatives: dict[str, Candidate] = {}
    leaders: dict[str, Candidate] = {}  # by mode: the candidate whose initial state is checked; other modes were accepted before
    for candidate in pending if starts else ():
        key = initial_state_checks.key(candidate.model.text, candidate.robot)
        if key in representatives or not accepted.start(key):
            leaders[candidate.mode] = representatives.setdefault(key, candidate)
    states: dict[str, initial_state_checks.InitialState] = {}
    verified: set[str] = set()
    shapes = (one for several in (geometry.shapes, *geometry.modes.values()) for one in several)
    true_meshes = {shape.mesh for one in shapes for shape in one.collision if shape.mesh is not None}
    unreduced = any(changes_meshes(candidate.root) for candidate in pending)
    replacements = [] if unreduced or not pending else _check_meshes_separately(accepted, true_meshes if representatives else ())
    checked_modes = {candidate.mode for candidate in representatives.values()}
    for candidate, result, files in _compile_scenes(pending, accepted, checked_modes, true_meshes, verified, replacements):
        if result.error is not None:
            _explain(candidate, files, report, scene_error=result.error)
            continue
        leader = leaders.get(candidate.mode)
        if leader is candidate:
            states[candidate.mode] = initial_state_checks.check_state(result.model, candidate.robot)
            if states[candidate.mode].in_order:
                accepted.accept_start(initial_state_checks.key(candidate.model.text, candidate.robot))
        elif leader is not None and leader.mode in states:
            states[candidate.mode] = replace(states[leader.mode], robot=candidate.robot)
        if not result.warnings and (leader is None or candidate.mode in states and states[candidate.mode].in_order):
            accepted.accept(candidate.texts, started=starts)
            memo.keep(*_state_independent_key(candidate), True)
            followers = [other for other in pending if leader is candidate and leaders.get(other.mode) is candidate]
            verified.update(other.mode for other in followers if memo.last(*_state_independent_key(other)))
        for warning in result.warnings:
            _report_message(Code.MJCF_WARNING, "warns of", warning, candidate, candidate.model, report, severity=Severity.WARNING)
    initial_state_checks.report_states([states[candidate.mode] for candidate in pending if candidate.mode in states], report)


def _compile_scenes(
    candidates: Sequence[Candidate], accepted: AcceptedModels, checked_modes: Collection[str], true_meshes: Collection[str],
    verified: Collection[str], replacements: Sequence[Mapping[str, bytes]],
) -> Iterator[tuple[Candidate, CompileResult, Any]]:
    """Compile each scene with MuJoCo, and yield the results and the files that MuJoCo read.

    The modes in `checked_modes`, whose initial states are checked, come first. Their scenes need the true meshes whose names are in
    `true_meshes`. Other modes are skipped if they are in `verified`, to which the caller adds modes. `replacements` contains sets of
    replacements for meshes; each set is used until MuJoCo reports a message (see `_check_meshes_separately`).

    The scenes are compiled one after the other, because MuJoCo caches files by name. If several scenes were compiled in parallel, a scene
    could get the model of another scene, or the process could crash. MuJoCo also caches the meshes of the first scene. Therefore, only the
    first compilation needs threads. The textures are the same in all scenes, so only the first scene generates textures.
    """
    first, remaining = True, [*replacements, {}]
    for kept_meshes in (true_meshes, ()):
        batch = [item for item in candidates if (item.mode in checked_modes) is (kept_meshes is true_meshes) and item.mode not in verified]
        if not batch:
            continue
        files = in_memory(accepted.data([item.root for item in batch], kept_meshes, remaining[0]))
        for candidate in batch:
            model, scene = candidate.model.text, candidate.scene.text
            files[candidate.file] = (model if first else _without_threads(model)).encode()
            result = attempt(scene if first else _shrink_textures(scene), files)
            while len(remaining) > 1 and not _is_acceptable(result, candidate.robot, boxes=len(remaining) > 2):
                del remaining[0]
                files = in_memory(accepted.data([item.root for item in batch], kept_meshes, remaining[0]))
                files[candidate.file] = model.encode()
                result = attempt(scene, files)
            yield candidate, result, files
            first = False


def _is_acceptable(result: CompileResult, robot: Robot, *, boxes: bool) -> bool:
    """Return whether a scene with replaced meshes compiles without messages, so that the true meshes need not be compiled.

    If the replacements are bounding boxes (`boxes`), they must not overlap.
    """
    return result.error is None and not result.warnings and not (boxes and initial_state_checks.check_state(result.model, robot).overlaps)


def _check_meshes_separately(accepted: AcceptedModels, true_meshes: Collection[str]) -> list[Mapping[str, bytes]]:
    """If the meshes together are too large for one compilation, compile each mesh separately. Otherwise, return an empty list.

    Return two mappings from file names to replacements for the meshes whose names are in `true_meshes`. The first mapping contains bounding
    boxes, which overlap if their meshes overlap. The second mapping contains the convex hulls that MuJoCo uses for contacts. A mesh for
    which MuJoCo reports a message is not replaced.
    """
    unread = accepted.unread(true_meshes)
    if sum(mesh.stored.size for mesh in unread) <= MAX_MESH_BYTES:
        return []
    import mujoco

    boxes: dict[str, bytes] = {}
    hulls: dict[str, bytes] = {}
    for mesh in unread:
        collides = mesh.name in true_meshes
        root = Element(tag="mujoco")
        root.add("asset").children += elements.meshes((mesh,))
        root.add("worldbody").add("geom", {"type": "mesh", "mesh": mesh.name, **({} if collides else {"contype": "0", "conaffinity": "0"})})
        result = attempt(write(root, "").text, in_memory({mesh.file: accepted.store.read(mesh.stored.sha256)}))
        mujoco.mj_clearCache(mujoco.mj_getCache())
        if result.error is None and not result.warnings:
            accepted.accept_meshes(mesh)
            if collides:
                corners, sides = _hull(result.model, mesh)
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
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.mesh_quat[0])
    scale = 1.0 if mesh.original is None or mesh.scale is None else mesh.scale
    points = (model.mesh_vert[corners] @ rotation.reshape(3, 3).T + model.mesh_pos[0]) / scale
    index_of = {int(corner): number for number, corner in enumerate(corners)}
    return points.tolist(), [[index_of[int(corner)] for corner in side] for side in faces.reshape(-1, 3)]


_NUMBERS = re.compile(r'(?<=[" ])-?[0-9][0-9.e+-]*(?=[" ])')
"""Pattern that matches numbers in the values of attributes."""


def select_models(candidates: Sequence[Candidate], share: int, memo: Memo) -> list[Candidate]:
    """Return the candidates to compile: of the models that differ only in numbers, the first one and then every `share`-th one."""
    if share <= 1:
        return list(candidates)
    selected = []
    for candidate in candidates:
        key = _kind_key(candidate)
        count: int | None = memo.last(key, ())
        if count is None or count % share == 0:
            selected.append(candidate)
        if count is not None:
            memo.keep(key, (), count + 1)
    return selected


def record_accepted(candidates: Sequence[Candidate], share: int, memo: Memo) -> None:
    """Record that MuJoCo accepted the scenes of these models without messages, for `remaining` and `select_models`."""
    for candidate in candidates:
        memo.keep(*_scene_key(candidate), True)
        if share > 1 and memo.last(_kind_key(candidate), ()) is None:
            memo.keep(_kind_key(candidate), (), 1)


def _kind_key(candidate: Candidate) -> tuple[str, str, str]:
    """Return a key for a model, which is its XML text without numbers. Models that differ only in numbers have the same key."""
    return ("mujoco takes", candidate.mode, hashlib.sha256(_NUMBERS.sub("", candidate.model.text).encode()).hexdigest())


def remaining(candidates: Sequence[Candidate], meshes: Sequence[MeshAsset], store: Store, memo: Memo, *, starts: bool) -> list[Candidate]:
    """Check models with a faster method than `check`. Return the candidates that this method has not accepted, for `check`.

    The method compiles the model without its scene, and replaces meshes that MuJoCo has accepted by tetrahedra. It is possible if MuJoCo
    has accepted a scene that differs only in numbers, and if `starts` is True, also the same initial state. A model for which MuJoCo
    reports messages is returned, so that `check` can find their cause.
    """
    similar = [candidate for candidate in candidates if memo.last(*_scene_key(candidate)) is not None]
    accepted = AcceptedModels(store, mujoco_version(), meshes)
    if starts and similar:
        similar = [candidate for candidate in similar if accepted.start(initial_state_checks.key(candidate.model.text, candidate.robot))]
    similar = [candidate for candidate in similar if not changes_meshes(candidate.root)]
    if not similar:
        return list(candidates)
    files = memo("mujoco files", lambda _: in_memory(accepted.data(())), tuple(meshes))
    results = {candidate.mode: attempt(_without_threads(candidate.model.text), files) for candidate in similar}
    accepted_modes = {mode for mode, result in results.items() if result.error is None and not result.warnings}
    if len(accepted_modes) == len(similar):
        accepted.accept_meshes()
    return [candidate for candidate in candidates if candidate.mode not in accepted_modes]


def _state_independent_key(candidate: Candidate) -> tuple[tuple[str, str], tuple[str, tuple[str, ...]]]:
    """Return a key and inputs of `Memo` for the contents of a mode that do not affect its initial state.

    The inputs are the scene without numbers, and the parts of the model that `initial_state_checks.key` omits.
    """
    return ("mujoco own", candidate.mode), (
        _NUMBERS.sub("", candidate.scene.text), initial_state_checks.irrelevant_parts(candidate.model.text),
    )


def _scene_key(candidate: Candidate) -> tuple[tuple[str, str], tuple[str]]:
    """Return a key and inputs of `Memo` for an accepted scene. The input is the XML text of the scene without numbers."""
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

    with collect_warnings() as warnings:
        try:
            model, error = mujoco.MjModel.from_xml_string(text, vfs=files), None
        except (ValueError, mujoco.FatalError) as fault:
            model, error = None, str(fault)
    return CompileResult(error=error, warnings=tuple(warnings), model=model)


@contextmanager
def collect_warnings() -> Iterator[list[str]]:
    """Collect the warnings of MuJoCo in a list, until the context ends.

    By default, MuJoCo prints warnings and writes them to `MUJOCO_LOG.TXT` in the working folder.
    """
    import mujoco

    warnings: list[str] = []
    original = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(warnings.append)
    try:
        yield warnings
    finally:
        mujoco.set_mju_user_warning(original)


def _explain(candidate: Candidate, files: Any, report: Report, *, scene_error: str) -> None:
    """Report why MuJoCo rejects a model: all raw attributes that cause an error, and at most one other cause.

    MuJoCo stops at the first error in a model. Therefore, the raw attribute that causes an error is removed, and the model is compiled
    again.
    """
    xml = candidate.model
    while True:
        error = attempt(xml.text, files).error
        if error is None:
            break
        element = _element_at(error, xml)
        cause = _find_raw_cause(error, element, candidate, files)
        if cause is None:
            _report_message(Code.MJCF_REFUSED, "rejects", error, candidate, xml, report)
            return
        owner, name, value = cause
        has_name = bool(owner.origin) and "name" in owner.attributes  # an `option`, for example, comes from several items of the document
        report.add(
            Code.MJCF_REFUSED, f"MuJoCo rejects `{name}` of {owner.label}: {_shorten_message(error)}", value.attribute.origin,
            path=".".join(("raw", value.attribute.target, *value.attribute.path)),
            help="use an attribute and a value from the XML reference of MuJoCo",
            notes=[Note(message=f"{owner.label} is defined here", span=owner.origin[0])] if has_name else (),
        )
        xml = write(candidate.root, candidate.heading)
    if xml is candidate.model:
        message = f"MuJoCo rejects the scene of mode `{candidate.mode}`: {_shorten_message(scene_error)}"
        report.add(Code.MJCF_REFUSED, message, candidate.robot.mode.origin, path=candidate.mode)


def _find_raw_cause(error: str, element_at_error: Element | None, candidate: Candidate, files: Any) -> tuple[Element, str, RawValue] | None:
    """Find the raw attribute that causes an error, remove it from the model, and return it. Return None if no raw attribute causes the
    error.

    An attribute is the cause if its removal changes the error. The attributes of the element in the error message are tried first,
    beginning with attributes that the message names. All other attributes of the model are tried afterwards.
    """
    quoted = set(re.findall(r"[A-Za-z_]\w*", error))
    own_attributes = [(element_at_error, name) for name in element_at_error.raw] if element_at_error is not None else []
    other_attributes = [(element, name) for element in candidate.root.walk() if element is not element_at_error for name in element.raw]
    for element, name in (*sorted(own_attributes, key=lambda pair: pair[1] not in quoted), *other_attributes):
        value = element.unset_raw(name)
        if attempt(write(candidate.root, candidate.heading).text, files).error != error:
            return element, name, value
        element.set_raw(name, value.attribute)
    return None


def _report_message(
    code: Code, verb: str, text: str, candidate: Candidate, xml: XmlText, report: Report, *,
    severity: Severity = Severity.ERROR,
) -> None:
    """Report a message of MuJoCo at a location in the documents.

    The location is the origin of the element that the message concerns, or of the raw attribute that the message names.
    """
    concerned = _element_at(text, xml)
    for element in (concerned,) if concerned is not None else candidate.root.walk():
        for name, value in element.raw.items():
            if f"'{name}'" in text:
                message = f"MuJoCo {verb} `{name}` of {element.label}: {_shorten_message(text)}"
                path = ".".join(("raw", value.attribute.target, *value.attribute.path))
                report.add(code, message, value.attribute.origin, path=path, severity=severity)
                return
    subject = "the model" if concerned is None or concerned.tag == "mujoco" else concerned.label
    origin = concerned.origin if concerned is not None and concerned.origin else candidate.robot.mode.origin
    name_of = (concerned.get("name") or None) if concerned is not None else None
    report.add(code, f"MuJoCo {verb} {subject}: {_shorten_message(text)}", origin, path=name_of, severity=severity)


def _element_at(text: str, xml: XmlText) -> Element | None:
    """Return the element to which a message of MuJoCo refers. The element is found by its line number, or else by its name. Return None if
    the message does not refer to an element.
    """
    line = re.search(r"\bline (?:number=)?(\d+)", text, re.IGNORECASE)
    if line:
        return xml.element_at(int(line[1]))
    name = re.search(r"Element name '([^']+)'", text) or re.search(r"'([^']+)'", text)
    if name is None:
        return None
    matching = [element for element in xml.lines if element is not None and element.get("name") == name[1]]
    kind = re.search(r"\b(keyframe|mesh|material|joint|geom|site|body|actuator)\b", text)
    tag = {"keyframe": "key"}.get(kind[1], kind[1]) if kind else None
    return next((element for element in matching if element.tag == tag), matching[0] if matching else None)


def _shorten_message(text: str) -> str:
    """Return a message of MuJoCo without the parts that are only useful to a reader of the XML file."""
    parser = re.search(r"Error=(XML_\w+)", text)
    if parser is not None:
        deep = " (a chain of links has more than 500 levels)" if parser[1] == "XML_ELEMENT_DEPTH_EXCEEDED" else ""
        return f"XML parser error {parser[1]}{deep}"
    first = next((line for line in text.splitlines() if line.strip()), "no reason given")
    return re.sub(r"^(?:(?:XML )?Error: |Schema violation: |error )+", "", first.strip()).rstrip(".")
