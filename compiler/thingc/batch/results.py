"""Load the results of a batch from its folder: the built variants with their settings, rows of the table and MuJoCo models.

    legs = thingc.batch.load("build/leg_sweep", mode="standing")
    for variant in legs:
        model = variant.model()             # a mujoco.MjModel
"""

from __future__ import annotations

import os
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import islice
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any, overload

from thingc.base.diagnostics import shown_path
from thingc.base.exceptions import PicklableError
from thingc.base.filesystem import listing
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineRepr, format_count
from thingc.base.suggestions import Hint, did_you_mean
from thingc.batch import folder_layout
from thingc.batch.build_records import BuildRecords, File, VariantFiles, contains, unpack
from thingc.batch.folder import check_chunks, read_batch
from thingc.batch.folder_layout import Line
from thingc.batch.mesh_files import MeshFiles
from thingc.batch.packed_layout import is_packed
from thingc.batch.rules import PARAMETERS
from thingc.batch.tables import flat
from thingc.targets.artifact import MANIFEST

if TYPE_CHECKING:
    import mujoco

    from thingc.batch.mujoco_arrays.text_models import ModelText, TextModels
    from thingc.modes import Modes

VARIANTS, NAMES = 4096, 10_000
"""Maximum number of cached variants, and maximum number of names that are searched for suggestions."""

_WITHIN, _INCLUDE = re.compile("<mujoco[^>]*>(.*)</mujoco>", re.DOTALL), re.compile("<include [^>]*/>")
"""Regular expressions that match the content of a MuJoCo model file, and the include element in a scene file."""


class FamilyError(PicklableError, ValueError):
    """Raised if a batch or a family of robots cannot be used as requested.

    The message contains the `reason` and, if given, a `help` text.
    """

    def __init__(self, reason: str, help: Hint = "") -> None:
        super().__init__(reason, help)
        self.reason, self.help = reason, help

    def __str__(self) -> str:
        return f"{self.reason}: {self.help}" if self.help else self.reason


class UnknownVariant(FamilyError, KeyError):
    """Raised for a name that does not exist, such as the name of a variant, column or mode."""


def require_known(name: str, known: Iterable[str], message: str, *, what: str) -> None:
    """Raise `UnknownVariant` with the given message if `name` is not one of the `known` names of `what`, such as `"modes"`."""
    if name not in known:
        raise UnknownVariant(message, did_you_mean(str(name), known, what=what))


class Sizes(FrozenStruct):
    """The sizes of a MuJoCo model: the number of position coordinates `nq`, of degrees of freedom `nv` and of controls `nu`."""

    nq: int
    nv: int
    nu: int


Where = Callable[["BuiltVariant"], bool] | Mapping[str, Any]
"""A filter for variants: a function of a `BuiltVariant`, or a mapping from columns to values.

The value `(low, high)` is a range, including both ends.
"""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class BuiltVariant(OneLineRepr):
    """A variant of a batch that has been built. Two `BuiltVariant` objects are equal if they have the same folder.

    `index` is the position of the variant in the plan. `settings` contains the parameters (in SI units) and choices of the variant by name.
    `results` is the table row of the variant, without empty cells. `folder` is the build folder of the variant. In a packed batch, this
    folder exists only after a call of `unpack`.
    """

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
        """Compile the MuJoCo model of the variant in a mode. Every call returns a new MuJoCo model.

        For many variants, `BatchResults.models` is much faster. With `scene`, the model includes the floor and the light of the scene.
        Without `visual`, visual geometry is omitted: the model moves in the same way, and compiles in less than half the time. `mode` can
        be omitted if the batch has a single mode. Raises `UnknownVariant` for an unknown mode, and `FamilyError` if the variant does not
        have a model.
        """
        mode = self.family.choose_mode(mode)
        return self._compile(self._text(mode, scene, visual), self._files.meshes())

    def model_text(self, mode: str, scene: bool, visual: bool) -> ModelText:
        """Return the text and meshes that `model` compiles for the same arguments. Raises the same errors as `model`."""
        from thingc.batch.mujoco_arrays.text_models import ModelText

        text, meshes = self._text(mode, scene, visual), self._files.meshes()
        return ModelText(
            text=text, meshes=tuple((name, file) for name, (file, _) in meshes.items()), assets=lambda: self.family.meshes.of(meshes),
            compiled=lambda: self._compile(text, meshes),
        )

    def _text(self, mode: str, scene: bool, visual: bool) -> str:
        """Return the XML text of the MuJoCo model in a mode. With `scene`, return the XML text of the scene, which includes the model."""
        text = self._read(f"{self.family.robot}_{mode}.xml").decode()
        if not visual:
            text = text.replace("<compiler ", '<compiler discardvisual="true" ', 1)
        if not scene:
            return text
        content = _WITHIN.search(text)
        assert content is not None
        return _INCLUDE.sub(lambda _: content[1], self._read(f"scene_{mode}.xml").decode(), count=1)

    def _compile(self, text: str, meshes: Mapping[str, tuple[File, str]]) -> mujoco.MjModel:
        import mujoco

        # MuJoCo has cached most meshes, so starting threads would take longer
        text = text.replace("<compiler ", '<compiler usethread="false" ', 1)
        try:
            with self.family.meshes.mount(meshes) as files:
                return mujoco.MjModel.from_xml_string(text, vfs=files)
        except ValueError as fault:
            raise FamilyError(f"MuJoCo rejects the model of variant `{self.name}`: {' '.join(str(fault).split())}") from fault

    def sources(self, mode: str | None = None, *, scene: bool = False) -> tuple[bytes, dict[str, bytes]]:
        """Return the XML text of the MuJoCo model in a mode, and the contents of its mesh files by file name.

        The mapping contains the meshes of all modes of the variant. With `scene`, the mapping also contains the model that the scene
        includes. Raises the same errors as `model`.
        """
        mode = self.family.choose_mode(mode)
        robot = f"{self.family.robot}_{mode}.xml"
        text = self._read(robot)
        files = self.family.meshes.of(self._files.meshes())
        return (self._read(f"scene_{mode}.xml"), {**files, robot: text}) if scene else (text, files)

    def sizes(self, mode: str | None = None) -> Sizes:
        """Return the sizes of the MuJoCo model in a mode. The sizes are read from the XML without compiling the model.

        Raises the same errors as `model`.
        """
        root = ElementTree.fromstring(self._read(f"{self.family.robot}_{self.family.choose_mode(mode)}.xml"))
        free = sum(1 for _ in root.iter("freejoint"))
        single = sum(len(body.findall("joint")) for body in root.iter("body"))  # models of a batch contain only hinges and slides
        return Sizes(nq=7 * free + single, nv=6 * free + single, nu=sum(len(section) for section in root.findall("actuator")))

    def modes(self) -> Modes:
        """Return the modes of the variant as an object that can switch between modes at run time."""
        from thingc.modes import Modes

        return Modes.parse(self._files.read("modes.json"))

    def unpack(self) -> str:
        """Return the path of the build folder of the variant.

        For a packed batch, write the folder of the variant first. Raises `OSError` if reading or writing fails.
        """
        if is_packed(self.family.folder):
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
                f"the MuJoCo model `{shown_path(os.path.join(self.folder, 'mjcf', file))}` does not exist",
                "build the batch again with `--emit mjcf`",
            ) from None


class BatchResults(Sequence[BuiltVariant]):
    """The built variants of a batch, in the order of the plan.

    To get a variant, use its index (`results[0]`, `results[-1]`), or its id or name (`results["sweep_07"]`).

    `planned` is the number of variants in the plan. `finished` is True if the batch has finished; otherwise, the object contains the
    variants that have been built so far. `rows` contains the rows of the table for all finished variants, including failed and excluded
    variants.
    """

    def __init__(
        self, folder: str, described: Mapping[str, Any], mode: str | None, robot: str, records: BuildRecords, meshes: MeshFiles,
        indices: Sequence[int] | None = None,
    ) -> None:
        """Create the results of a batch from the content of its folder.

        `described` is the content of `batch.json`, and `robot` is the name of the assembly. `mode` is the default mode of the results.
        `indices` contains the indices of the selected variants in the plan (default: all built variants).
        """
        self.folder = folder
        self.name: str = described["name"]
        self.robot = robot
        self.mode_names: tuple[str, ...] = tuple(described["modes"])
        self.mode = mode
        self.planned: int = described["count"]
        self.finished: bool = described["finished"]
        self.records = records
        self._batch = folder, described, mode, robot, records, meshes
        self.meshes = meshes
        self._indices = records.built if indices is None else indices
        self._variant = lru_cache(VARIANTS)(self._read_variant)
        self._models: dict[tuple[str, bool, bool], TextModels] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        """Support pickling, which workers of environments and process pools require."""
        return BatchResults, (*self._batch, self._indices)

    def _of(self, indices: Sequence[int]) -> BatchResults:
        return BatchResults(*self._batch, indices)

    def _read_variant(self, index: int) -> BuiltVariant:
        """Return the variant with this index in the plan."""
        line = self.records.line(index)
        return BuiltVariant(
            id=line["id"], name=line["name"], index=index, settings={**line["parameters"], **line["choices"]}, results=_row(line),
            folder=folder_layout.variant_folder(self.folder, line["id"]), family=self,
        )

    @property
    def rows(self) -> Sequence[Mapping[str, Any]]:
        """The rows of the table for all finished variants, including failed and excluded variants."""
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
        """Return the variant with this index, id or name. For a slice, return a `BatchResults` with the selected variants.

        Raises `UnknownVariant` for an unknown id or name, and `IndexError` for an invalid index.
        """
        if not isinstance(key, Integral | slice | str):
            raise UnknownVariant(f"batch `{self.name}` has no variant `{key}`", "use the index, the id or the name of a variant")
        if isinstance(key, slice):
            return self._of(self._indices[key])
        if isinstance(key, str):
            return self._find_variant(key)
        if not -len(self) <= key < len(self):
            raise IndexError(f"index {key} is out of range for batch `{self.name}` with {format_count(len(self), 'variant')}")
        return self._variant(self._indices[key])

    def _find_variant(self, key: str) -> BuiltVariant:
        index = self.records.find(key)
        if index is None:
            names = [name for variant in islice(self, NAMES) for name in (variant.name, variant.id)]
            raise UnknownVariant(f"batch `{self.name}` has no variant `{key}`", did_you_mean(key, names, what="variants"))
        if not contains(self._indices, index):
            row = _row(self.records.line(index))
            known = f"status `{row['status']}`" if row["status"] != "built" else "not loaded"
            raise UnknownVariant(f"the variant `{key}` is not available: {known}{_because(row)}")
        return self._variant(index)

    def __repr__(self) -> str:
        return f"Family({self.name!r}, {len(self)} of {format_count(self.planned, 'variant')})"

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """The names of all non-empty columns of the table, in order."""
        return tuple(dict.fromkeys(name for row in self.rows for name in row))

    def column(self, name: str) -> list[Any]:
        """Return the cells of a column as a list, for all selected variants. Empty cells are None.

        Raises `UnknownVariant` for an unknown column.
        """
        cells = [variant.results.get(name) for variant in self]
        if all(cell is None for cell in cells) and name not in self.columns:
            raise UnknownVariant(f"batch `{self.name}` has no column `{name}`", did_you_mean(str(name), self.columns, what="columns"))
        return cells

    def filter(self, where: Where) -> BatchResults:
        """Return a `BatchResults` with only those variants that satisfy the condition `where`.

        Raises `UnknownVariant` for an unknown column, and `FamilyError` for an invalid condition.
        """
        if isinstance(where, Mapping):
            matches = [True] * len(self)
            for name, condition in where.items():
                cells = self.column(name)
                _check(name, condition, cells)
                matches = [is_match and _holds(cell, condition) for is_match, cell in zip(matches, cells, strict=True)]
        elif callable(where):
            matches = [bool(where(variant)) for variant in self]
        else:
            raise FamilyError(f"expected `where` to be a mapping from columns to values, or a function of a variant, found `{where}`")
        return self._of(tuple(index for index, is_match in zip(self._indices, matches, strict=True) if is_match))

    def choose_mode(self, mode: str | None) -> str:
        """Return the name of the mode that a method must use. If `mode` is None, return the default mode, or else the only mode.

        Raises `UnknownVariant` for an unknown mode, and `FamilyError` if `mode` is None and the batch has several modes.
        """
        name = mode if mode is not None else self.mode
        if name is None:
            if len(self.mode_names) > 1:
                known = ", ".join(f"`{mode_name}`" for mode_name in self.mode_names)
                raise FamilyError(f"batch `{self.name}` has {len(self.mode_names)} modes ({known})", "select a mode with `mode=\"...\"`")
            name = self.mode_names[0]
        require_known(name, self.mode_names, f"batch `{self.name}` has no mode `{name}`", what="modes")
        return name

    def models(
        self, variants: Iterable[BuiltVariant] | None = None, mode: str | None = None, *, share: bool = False, scene: bool = False,
        visual: bool = True,
    ) -> Iterator[mujoco.MjModel]:
        """Yield the MuJoCo models of several variants in order.

        If `variants` is None, yield the models of all variants. The models equal the results of `BuiltVariant.model`. If variants differ
        only in numbers, MuJoCo compiles only some of the models. For all other models, numbers are written into the arrays of a compiled
        model. At most 128 variants are read ahead. With `share`, several yielded models can be the same object: a model is then valid until
        the next model is requested. Raises the same errors as `BuiltVariant.model`, and `FamilyError` for values that are not variants.
        This method is not thread-safe.
        """
        from thingc.batch.mujoco_arrays.text_models import TextModels

        key = (self.choose_mode(mode), scene, visual)
        models = self._models.setdefault(key, TextModels())
        selected = self if variants is None else variants if isinstance(variants, Iterable) else [variants]
        return models.each((_variant(variant).model_text(*key) for variant in selected), share=share)


class _Rows(Sequence[Mapping[str, Any]]):
    """The rows of a table of results, as a sequence of mappings. A row is read from disk when it is used."""

    def __init__(self, records: BuildRecords) -> None:
        self._records = records

    def __len__(self) -> int:
        return len(self._records.done)

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, slice):
            return [_row(self._records.line(index)) for index in self._records.done[key]]
        return _row(self._records.line(self._records.done[key]))


def load(folder: str | os.PathLike[str], mode: str | None = None, where: Where | None = None) -> BatchResults:
    """Load the built variants of the batch in a folder such as `build/leg_sweep`.

    `mode` is the default mode of the returned object. `where` selects variants by a condition: `{"status": "built"}`, `{"mass": (0, 2.5)}`
    or a function of a `BuiltVariant`. Only the journal of the batch is read at first. Raises `FamilyError` if the folder does not contain a
    batch, `UnknownVariant` for an unknown mode or column, and `OSError` if a chunk of a packed batch is damaged or missing.
    """
    import json

    path = os.path.abspath(os.fsdecode(folder))
    described = read_batch(path)
    if described is None:
        batches = [name for name in listing(path) if read_batch(os.path.join(path, name))]
        hint = f" (batches inside: {', '.join(f'`{name}`' for name in batches)})" if batches else ""
        raise FamilyError(f"`{shown_path(path)}` is not the folder of a batch{hint}", "run `thingc batch` to create a batch")
    check_chunks(path, described)
    records = BuildRecords(path)
    robot = json.loads(records.files(records.built[0]).read(MANIFEST))["name"] if records.built else ""
    family = BatchResults(path, described, mode, robot, records, MeshFiles())
    if mode is not None:
        family.choose_mode(mode)
    return family if where is None else family.filter(where)


def _row(line: Line) -> dict[str, Any]:
    """Return the non-empty cells of the table row for a journal line. All numbers except counts are floats."""
    numbers = {name: float(value) for name, value in line.get("results", {}).items()}
    for name, value in line["parameters"].items():
        if isinstance(value, int) and not isinstance(value, bool):
            numbers[PARAMETERS + name] = float(value)
    return {name: numbers.get(name, value) for name, value in flat(line).items() if value is not None}


def _variant(value: Any) -> BuiltVariant:
    if not isinstance(value, BuiltVariant):
        raise FamilyError(f"expected variants, found `{value}`", "use `family[...]` with the index, the id or the name of a variant")
    return value


def _check(name: str, condition: Any, cells: Sequence[Any]) -> None:
    """Raise `FamilyError` if the `condition` of a filter has another type than the cells of its column, so that it selects nothing."""
    if not isinstance(condition, tuple):
        if condition is not None and not isinstance(condition, str | Real):
            raise FamilyError(f"expected a value for the column `{name}`, or a range `(low, high)`, found `{condition}`")
        return
    if len(condition) != 2 or not all(isinstance(bound, Real) for bound in condition) or not condition[0] <= condition[1]:
        raise FamilyError(f"expected a range of the column `{name}` to be two numbers `(low, high)`, found `{condition}`")
    text = next((cell for cell in cells if isinstance(cell, str)), None)
    if text is not None:
        raise FamilyError(f"expected a string for the column `{name}`, such as `{text}`, found the range `{condition}`")


def _holds(cell: Any, condition: Any) -> bool:
    if isinstance(condition, tuple):
        return cell is not None and condition[0] <= cell <= condition[1]
    return bool(cell == condition)


def _because(row: Mapping[str, Any]) -> str:
    if "rule" in row:
        return f" (rule `{row['rule']}`)"
    return f" ({row['code']}: {row['message']})" if "code" in row else ""
