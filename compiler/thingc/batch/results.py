"""A batch's folder read back: its variants with their settings, their rows of the table and their models.

    legs = thingc.batch.load("build/leg_sweep", mode="standing")
    for variant in legs:
        model = variant.model()             # a mujoco.MjModel
"""

from __future__ import annotations

import contextlib
import os
import re
import threading
import xml.etree.ElementTree as ElementTree
from bisect import bisect_left
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any, overload

from thingc.base.diagnostics import Code, shown_path
from thingc.base.filesystem import listing
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineRepr, counted
from thingc.base.suggestions import did_you_mean
from thingc.batch import folder_layout
from thingc.batch.build_records import BuildRecords, File, VariantFiles, unpack
from thingc.batch.folder import BatchFault, in_words, read_batch, whole
from thingc.batch.folder_layout import Line
from thingc.batch.mujoco_arrays.text_models import ModelText, TextModels
from thingc.batch.packed_layout import packed
from thingc.batch.planning import Plan, Variant
from thingc.batch.rules import PARAMETERS
from thingc.batch.tables import flat
from thingc.targets.artifact import MANIFEST

if TYPE_CHECKING:
    import mujoco

    from thingc.modes import Modes

VARIANTS, NAMES = 4096, 10_000
"""How many variants a family keeps that were asked for last, and of how many names the nearest is told."""
MESH_BYTES = 256 * 2**20
"""How many bytes of meshes a family keeps in memory."""

_WITHIN, _INCLUDE = re.compile("<mujoco[^>]*>(.*)</mujoco>", re.DOTALL), re.compile("<include [^>]*/>")
"""What a model's file says, and where that of its scene includes it."""


class FamilyError(ValueError):
    """A batch that cannot be used as it was asked to be; the message says why and what to do."""


class UnknownVariant(FamilyError, KeyError):
    """A variant, a column or a mode that the batch has not."""

    def __str__(self) -> str:
        return ValueError.__str__(self)  # a KeyError would show the repr


class Sizes(FrozenStruct):
    """Numbers of coordinates `nq`, degrees of freedom `nv` and controls `nu` of a model."""

    nq: int
    nv: int
    nu: int


Where = Callable[["BuiltVariant"], bool] | Mapping[str, Any]
"""Which variants: a function of one, or values by column; two numbers `(low, high)` are a range, its ends included."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class BuiltVariant(OneLineRepr):
    """A variant that has been built. `index` is its place in the plan, `settings` its parameters (SI) and choices by name,
    `results` its row of the table by column (absent where the table is empty), `folder` what `thingc build` would have written: of a
    packed batch there after `unpack`. The same variant of the same batch is equal."""

    id: str
    name: str
    index: int
    settings: Mapping[str, Any]
    results: Mapping[str, Any]
    folder: str
    family: BatchResults = field(repr=False)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, BuiltVariant) and other.folder == self.folder

    def __hash__(self) -> int:
        return hash(self.folder)

    def model(self, mode: str | None = None, *, scene: bool = False, visual: bool = True) -> mujoco.MjModel:
        """Its model in a mode, compiled anew at each call; `scene`: with floor and light. Without `visual` MuJoCo leaves out what
        is only drawn: the model moves in the same way, and is compiled in less than half the time. The mode may be left out where
        the family has one; of many variants `Family.models` takes a fraction of the time. Raises `UnknownVariant` for another mode, and
        `FamilyError` where there is no model."""
        mode = self.family.chosen(mode)
        return self._compiled(self._text(mode, scene, visual), self._files.meshes())

    def model_text(self, mode: str, scene: bool, visual: bool) -> ModelText:
        """What `model` compiles. Raises as `model` does."""
        text, meshes = self._text(mode, scene, visual), self._files.meshes()
        return ModelText(
            text=text, meshes=tuple((name, file) for name, (file, _) in meshes.items()), assets=lambda: self.family.meshes(meshes),
            compiled=lambda: self._compiled(text, meshes),
        )

    def _text(self, mode: str, scene: bool, visual: bool) -> str:
        """The text of the model, in that of its scene if that is wanted."""
        text = self._read(f"{self.family.robot}_{mode}.xml").decode()
        if not visual:
            text = text.replace("<compiler ", '<compiler discardvisual="true" ', 1)
        if not scene:
            return text
        own = _WITHIN.search(text)
        assert own is not None
        return _INCLUDE.sub(lambda _: own[1], self._read(f"scene_{mode}.xml").decode(), count=1)

    def _compiled(self, text: str, meshes: Mapping[str, tuple[File, str]]) -> mujoco.MjModel:
        import mujoco

        # Threads are for meshes, and MuJoCo has most of them from before: they cost more than they save.
        text = text.replace("<compiler ", '<compiler usethread="false" ', 1)
        try:
            with self.family.mounted(meshes) as files:
                return mujoco.MjModel.from_xml_string(text, vfs=files)
        except ValueError as fault:
            raise FamilyError(f"MuJoCo refuses the model of variant `{self.name}`: {' '.join(str(fault).split())}") from fault

    def sources(self, mode: str | None = None, *, scene: bool = False) -> tuple[bytes, dict[str, bytes]]:
        """The text of its model in a mode, and the files that this names; meshes are those of the whole family. Raises as
        `model` does."""
        mode = self.family.chosen(mode)
        robot = f"{self.family.robot}_{mode}.xml"
        text = self._read(robot)
        files = self.family.meshes(self._files.meshes())
        return (self._read(f"scene_{mode}.xml"), {**files, robot: text}) if scene else (text, files)

    def sizes(self, mode: str | None = None) -> Sizes:
        """The sizes of its model, read from the file: nothing is compiled. Raises as `model` does."""
        root = ElementTree.fromstring(self._read(f"{self.family.robot}_{self.family.chosen(mode)}.xml"))
        free = sum(1 for _ in root.iter("freejoint"))
        single = sum(len(body.findall("joint")) for body in root.iter("body"))  # hinges and slides, nothing else is written
        return Sizes(nq=7 * free + single, nv=6 * free + single, nu=sum(len(section) for section in root.findall("actuator")))

    def modes(self) -> Modes:
        """Its modes, to switch between at run time."""
        from thingc.modes import Modes

        return Modes.parse(self._files.read("modes.json"))

    def unpack(self) -> str:
        """Its folder, which is written first where the batch is packed. Raises `OSError`."""
        if packed(self.family.folder):
            unpack(self.family.folder, self.index)
        return self.folder

    @property
    def _files(self) -> VariantFiles:
        return self.family.records.files(self.index)

    def _read(self, file: str) -> bytes:
        try:
            return self._files.read(f"mjcf/{file}")
        except FileNotFoundError:
            raise FamilyError(
                f"there is no `{shown_path(os.path.join(self.folder, 'mjcf', file))}`: the batch has been built without the target "
                "`mjcf`, or was moved or changed since; build it again with `--emit mjcf`"
            ) from None


class BatchResults(Sequence[BuiltVariant]):
    """The built variants of a batch, in plan order: by place (`family[0]`, `family[-1]`), by id or name (`family["sweep_07"]`).

    `planned` is how many variants the plan has, `finished` whether the batch has finished; of one that has not there is what has
    been built so far. `rows` are the rows of the table of all variants that are done, those that failed or were kept out, too.
    """

    def __init__(
        self, folder: str, described: Mapping[str, Any], mode: str | None, robot: str, records: BuildRecords, meshes: _Meshes,
        indices: Sequence[int] | None = None,
    ) -> None:
        """Use a batch as it was when it was loaded. `described` is the content of `batch.json`, `mode` the default mode, and `robot` the
        name of the assembly. `indices` selects variants by their index in the plan (default: all that were built)."""
        self.folder = folder
        self.name: str = described["name"]
        self.robot = robot
        self.mode_names: tuple[str, ...] = tuple(described["modes"])
        self.mode = mode
        self.planned: int = described["count"]
        self.finished: bool = described["finished"]
        self.records = records
        self._batch = folder, described, mode, robot, records, meshes
        self._meshes = meshes
        self._indices = records.built if indices is None else indices
        self._made: OrderedDict[int, BuiltVariant] = OrderedDict()
        self._models: dict[tuple[str, bool, bool], TextModels] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        """Workers of environments and process pools are handed families and variants."""
        return BatchResults, (*self._batch, self._indices)

    def _of(self, indices: Sequence[int]) -> BatchResults:
        return BatchResults(*self._batch, indices)

    def _variant(self, index: int) -> BuiltVariant:
        """The variant at this place of the plan; those asked for last are kept."""
        made = self._made.get(index)
        if made is None:
            line = self.records.line(index)
            made = self._made.setdefault(index, BuiltVariant(
                id=line["id"], name=line["name"], index=index, settings={**line["parameters"], **line["choices"]},
                results=_row(line), folder=folder_layout.variant_folder(self.folder, line["id"]), family=self,
            ))
            if len(self._made) > VARIANTS:
                self._made.popitem(last=False)
        return made

    @property
    def rows(self) -> Sequence[Mapping[str, Any]]:
        """The rows of the table, of variants that failed or were kept out, too."""
        return _Rows(self.records)

    def __len__(self) -> int:
        return len(self._indices)

    def __iter__(self) -> Iterator[BuiltVariant]:
        return map(self._variant, self._indices)

    @overload
    def __getitem__(self, key: int | str) -> BuiltVariant: ...
    @overload
    def __getitem__(self, key: slice) -> BatchResults: ...
    def __getitem__(self, key: int | str | slice) -> BuiltVariant | BatchResults:
        """Raises `UnknownVariant` for an id or name, and `IndexError` for a place, that is not there."""
        if not isinstance(key, Integral | slice | str):
            raise UnknownVariant(f"batch `{self.name}` has no variant `{key}`: a variant is named by its place, its id or its name")
        if isinstance(key, slice):
            return self._of(self._indices[key])
        if isinstance(key, str):
            return self._named(key)
        if not -len(self) <= key < len(self):
            raise IndexError(f"batch `{self.name}` has {counted(len(self), 'variant')} here, and none at place {key}")
        return self._variant(self._indices[key])

    def _named(self, key: str) -> BuiltVariant:
        index = self.records.find(key)
        if index is None:
            names = [name for variant in islice(self, NAMES) for name in (variant.name, variant.id)]
            raise UnknownVariant(f"batch `{self.name}` has no variant `{key}`: {did_you_mean(key, names, what='variants')}")
        at = bisect_left(self._indices, index)
        if at == len(self) or self._indices[at] != index:
            row = _row(self.records.line(index))
            known = f"it is `{row['status']}`" if row["status"] != "built" else "it is left out here"
            raise UnknownVariant(f"the variant `{key}` cannot be had: {known}{_because(row)}")
        return self._variant(index)

    def __repr__(self) -> str:
        return f"Family({self.name!r}, {len(self)} of {counted(self.planned, 'variant')})"

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """The columns of the table that any variant has, in their order."""
        return tuple(dict.fromkeys(name for row in self.rows for name in row))

    def column(self, name: str) -> list[Any]:
        """The cells of a column, one for each variant here; None where it is empty. Raises `UnknownVariant`."""
        cells = [variant.results.get(name) for variant in self]
        if all(cell is None for cell in cells) and name not in self.columns:
            raise UnknownVariant(f"batch `{self.name}` has no column `{name}`: {did_you_mean(str(name), self.columns, what='columns')}")
        return cells

    def filter(self, where: Where) -> BatchResults:
        """The variants for which `where` holds. Raises `UnknownVariant` for a column that is not there, and `FamilyError` for what is
        neither a function nor values by column."""
        if isinstance(where, Mapping):
            kept = [True] * len(self)
            for name, wanted in where.items():
                cells = self.column(name)
                _check(name, wanted, cells)
                kept = [one and _holds(cell, wanted) for one, cell in zip(kept, cells, strict=True)]
        elif callable(where):
            kept = [bool(where(variant)) for variant in self]
        else:
            raise FamilyError(f"expected `where` to be values by column, or a function of a variant, found `{where}`")
        return self._of(tuple(index for index, one in zip(self._indices, kept, strict=True) if one))

    def chosen(self, mode: str | None) -> str:
        """The mode that is meant where `mode` is said. Raises `UnknownVariant` for one that has not been built, and
        `FamilyError` where several have been and none is said."""
        name = mode if mode is not None else self.mode
        if name is None:
            if len(self.mode_names) > 1:
                known = ", ".join(f"`{one}`" for one in self.mode_names)
                raise FamilyError(f"batch `{self.name}` has {len(self.mode_names)} modes, {known}: say which, `mode=\"...\"`")
            name = self.mode_names[0]
        if name not in self.mode_names:
            raise UnknownVariant(f"batch `{self.name}` has no mode `{name}`: {did_you_mean(str(name), self.mode_names, what='modes')}")
        return name

    def models(
        self, variants: Iterable[BuiltVariant] | None = None, mode: str | None = None, *, share: bool = False, scene: bool = False,
        visual: bool = True,
    ) -> Iterator[mujoco.MjModel]:
        """The models of some of its variants (None: of all), in their order, as `BuiltVariant.model` gives them. Of variants that differ in
        nothing but numbers some are compiled, and arrays are written for the others (up to 128 variants are read ahead). With `share` one
        model is lent: it is that of the variant until the next one is asked for, and nobody else's to change. Raises as
        `BuiltVariant.model` does, and `FamilyError` for what is no variant. Not for several threads at once."""
        key = (self.chosen(mode), scene, visual)
        models = self._models.setdefault(key, TextModels())
        many = self if variants is None else variants if isinstance(variants, Iterable) else [variants]
        return models.each((_variant(one).model_text(*key) for one in many), share=share)

    def meshes(self, files: Mapping[str, tuple[File, str]]) -> dict[str, bytes]:
        """Files by name, of each what it is and where it lies. A file that variants share is read once."""
        return self._meshes.of(files)

    def mounted(self, files: Mapping[str, tuple[File, str]]) -> AbstractContextManager[mujoco.MjVfs]:
        """Such files in MuJoCo's virtual file system: for one thread at a time. Variants with the same files use the same one."""
        return self._meshes.mounted(files)


class _Rows(Sequence[Mapping[str, Any]]):
    """The rows of a table, each made when it is asked for."""

    def __init__(self, records: BuildRecords) -> None:
        self._records = records

    def __len__(self) -> int:
        return len(self._records.done)

    @overload
    def __getitem__(self, key: int) -> Mapping[str, Any]: ...
    @overload
    def __getitem__(self, key: slice) -> Sequence[Mapping[str, Any]]: ...
    def __getitem__(self, key: int | slice) -> Mapping[str, Any] | Sequence[Mapping[str, Any]]:
        if isinstance(key, slice):
            return [_row(self._records.line(index)) for index in self._records.done[key]]
        return _row(self._records.line(self._records.done[key]))


class _Meshes:
    """Files by what they are: a mesh that variants share is one file. Those used least lately are forgotten when there are more than
    `most` bytes. What MuJoCo was given last is kept, too. Thread-safe; a copy in another process begins with nothing."""

    def __init__(self, most: int = MESH_BYTES) -> None:
        self._most = most
        self._size = 0
        self._kept: OrderedDict[File, bytes] = OrderedDict()
        self._lock = threading.Lock()
        self._last: tuple[Mapping[str, File], mujoco.MjVfs] | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """Workers of environments and process pools are handed families and variants."""
        return _Meshes, (self._most,)

    def of(self, files: Mapping[str, tuple[File, str]]) -> dict[str, bytes]:
        with self._lock:
            return self._read(files)

    def _read(self, files: Mapping[str, tuple[File, str]]) -> dict[str, bytes]:
        contents: dict[str, bytes] = {}
        for name, (file, path) in files.items():
            data = self._kept.get(file)
            if data is None:
                with open(path, "rb") as stream:
                    data = self._kept[file] = stream.read()
                self._size += len(data)
            self._kept.move_to_end(file)
            contents[name] = data
        while self._size > self._most and len(self._kept) > len(contents):
            self._size -= len(self._kept.popitem(last=False)[1])
        return contents

    @contextlib.contextmanager
    def mounted(self, wanted: Mapping[str, tuple[File, str]]) -> Iterator[mujoco.MjVfs]:
        import mujoco

        own = {name: file for name, (file, _) in wanted.items()}  # each variant has links to the same files in a folder of its own
        with self._lock:
            if self._last is None or self._last[0] != own:
                files = mujoco.MjVfs()
                for name, data in self._read(wanted).items():
                    files[name] = data
                self._last = own, files
            yield self._last[1]


def load(folder: str | os.PathLike[str], mode: str | None = None, where: Where | None = None) -> BatchResults:
    """The built variants of the batch in `folder` (`build/leg_sweep`).

    `mode` is the one that models are of unless said otherwise; `where` chooses variants: `{"status": "built"}`,
    `{"mass": (0, 2.5)}` or a function of a `BuiltVariant`. Nothing but the journal is read. Raises `FamilyError` for a folder
    that holds no batch, `UnknownVariant` for a mode or a column that is not there, and `OSError` for a chunk of a packed batch that is
    damaged or gone.
    """
    import json

    place = os.path.abspath(os.fsdecode(folder))
    described = read_batch(place)
    if described is None:
        within = [name for name in listing(place) if read_batch(os.path.join(place, name))]
        hint = f"; in it there are: {', '.join(f'`{name}`' for name in within)}" if within else ""
        raise FamilyError(f"`{shown_path(place)}` is no folder of a batch{hint}: `thingc batch` writes one")
    whole(place, described)
    records = BuildRecords(place)
    robot = json.loads(records.files(records.built[0]).read(MANIFEST))["name"] if records.built else ""
    family = BatchResults(place, described, mode, robot, records, _Meshes())
    if mode is not None:
        family.chosen(mode)
    return family if where is None else family.filter(where)


def _row(line: Line) -> dict[str, Any]:
    """The cells of a line that are not empty, as the table has them: numbers but counts are floats."""
    numbers = {name: float(value) for name, value in line.get("results", {}).items()}
    for name, value in line["parameters"].items():
        if isinstance(value, int) and not isinstance(value, bool):
            numbers[PARAMETERS + name] = float(value)
    return {name: numbers.get(name, value) for name, value in flat(line).items() if value is not None}


def _variant(one: Any) -> BuiltVariant:
    if not isinstance(one, BuiltVariant):
        raise FamilyError(f"expected variants, found `{one}`: `family[...]` is one by its place, its id or its name")
    return one


def _check(name: str, wanted: Any, cells: Sequence[Any]) -> None:
    """Raises `FamilyError` for what no cell of a column can be, so that nobody takes it for a family without variants."""
    if not isinstance(wanted, tuple):
        if wanted is not None and not isinstance(wanted, str | Real):
            raise FamilyError(f"expected a value for the column `{name}`, or a range `(low, high)`, found `{wanted}`")
        return
    if len(wanted) != 2 or not all(isinstance(one, Real) for one in wanted) or not wanted[0] <= wanted[1]:
        raise FamilyError(f"expected a range of the column `{name}` to be two numbers `(low, high)`, found `{wanted}`")
    text = next((cell for cell in cells if isinstance(cell, str)), None)
    if text is not None:
        raise FamilyError(f"expected a text for the column `{name}`, such as `{text}`, found the range `{wanted}`")


def _holds(cell: Any, wanted: Any) -> bool:
    if isinstance(wanted, tuple):
        low, high = wanted
        return cell is not None and low <= cell <= high
    return bool(cell == wanted)


def _because(row: Mapping[str, Any]) -> str:
    if "rule" in row:
        return f" by the rule `{row['rule']}`"
    return f" ({row['code']}: {row['message']})" if "code" in row else ""


def find_variant(plan: Plan, wanted: str, folder: str) -> tuple[Variant, str | None] | None:
    """Return the variant with this id or name, and the rule that it violates (or None); None if there is no such variant.

    Ids are computed from differences to the assembly document, and names are numbered. If a document has changed since the batch was built,
    as after each adopted variant, an id or a name can belong to another variant. So the variant of the batch in `folder` is matched by its
    settings. Raises `BatchFault` if no variant has these settings now.
    """
    line = _told(plan, wanted, folder)
    if line is None:
        variant = next((one for one in plan if wanted in (one.id, one.name)), None)
        return None if variant is None else (variant, variant.failed)
    for variant in plan:
        if (dict(variant.values), plan.chosen(variant)) == (line["parameters"], line["choices"]):
            return variant, variant.failed or line.get("rule")
    raise BatchFault(
        Code.BATCH_CHANGED,
        f"no variant of `{plan.relative}` has the settings any more that `{wanted}` has in `{shown_path(folder)}`",
        "the documents have changed since that batch was built: build it anew, and take an id from its table",
    )


def _told(plan: Plan, wanted: str, folder: str) -> Line | None:
    """The last line of the batch in `folder` that is about this id or name, if that is a batch of this document."""
    described = read_batch(folder)
    if described is None or described.get("document") != plan.relative:
        return None
    try:
        whole(folder, described)
        done = BuildRecords(folder)
        index = done.find(wanted)
        return None if index is None else done.line(index)
    except OSError as fault:
        raise in_words(folder, fault) from fault
