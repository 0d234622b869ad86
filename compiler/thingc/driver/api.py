"""The Python API of the compiler, such as `thingc.compile("assemblies/arm.yaml").modes["bench"].mjcf()`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from thingc.base.diagnostic_output import as_text
from thingc.base.diagnostics import Diagnostic, Report
from thingc.base.exceptions import PicklableError
from thingc.base.inertia import MassProperties
from thingc.base.one_line_repr import OneLineRepr, OneLineStruct
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options, Printed, with_environment
from thingc.model.assembly.types import Assembly
from thingc.model.robot.types import Robot
from thingc.targets.html.emit import Page, page_of


class CompileError(PicklableError):
    """Raised if a document has errors.

    `diagnostics` contains all errors and warnings. The string of the exception contains all diagnostics in the same format as on the
    command line.
    """

    def __init__(self, diagnostics: Sequence[Diagnostic]) -> None:
        super().__init__("\n" + as_text(diagnostics))
        self.diagnostics = tuple(diagnostics)


class CompiledMode(OneLineStruct):
    """A mode of a compiled robot. `robot` contains the kinematic tree of links and joints in this mode."""

    robot: Robot
    files: Mapping[str, bytes]

    @property
    def name(self) -> str:
        """The name of the mode."""
        return self.robot.mode.name

    def mjcf(self) -> str:
        """Return the MuJoCo model of this mode as XML text. The text is identical to the file that `thingc build` writes.

        The method `assets` returns the mesh files that the model uses.
        """
        return self.files[f"mjcf/{self.robot.assembly.name}_{self.name}.xml"].decode()

    def assets(self) -> dict[str, bytes]:
        """Return the contents of the mesh files that `mjcf()` uses, by file name.

        Pass the returned mapping to MuJoCo: `mujoco.MjModel.from_xml_string(xml, assets)`.
        """
        prefix = "mjcf/assets/"
        return {path.removeprefix(prefix): data for path, data in self.files.items() if path.startswith(prefix)}

    def model(self) -> Any:
        """Compile the MuJoCo model of this mode with its meshes, and return the `mujoco.MjModel`."""
        import mujoco

        return mujoco.MjModel.from_xml_string(self.mjcf(), self.assets())


class Shown(OneLineStruct):
    """An HTML page for display in a frame of a Jupyter notebook. `height` is the height of the frame in pixels."""

    page: str
    height: int

    def _repr_html_(self) -> str:
        """Return the HTML code that Jupyter displays for this object. The scripts of the page cannot access the notebook."""
        from html import escape

        return (
            f'<iframe srcdoc="{escape(self.page)}" sandbox="allow-scripts allow-downloads" '
            f'style="width: 100%; height: {self.height}px; border: 0" title="robot"></iframe>'
        )


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Compiled(OneLineRepr):
    """A compiled robot, with its modes in document order. `diagnostics` contains the warnings about the document.

    `modelled` contains the definition texts of the parts that were built, and `reused` the definition texts of the parts that were cached.
    """

    name: str
    assembly: Assembly
    modes: Mapping[str, CompiledMode]
    diagnostics: tuple[Diagnostic, ...]
    modelled: tuple[str, ...]
    reused: tuple[str, ...]
    _page: Callable[[], Page] = field(repr=False, compare=False)

    def show(self, height: int = 600) -> Shown:
        """Return the viewer page of the robot for a Jupyter notebook. The cell has the given height [pixels].

        Raises `BlobMissing` if a mesh of the robot has been deleted from the store.
        """
        return Shown(page=self._page().html().decode(), height=height)

    @property
    def hag(self) -> Any:
        """The hierarchical assembly graph of the robot as a `networkx.MultiDiGraph`. Its nodes are definitions of parts and assemblies."""
        from thingc.targets.hag.labels import quantities
        from thingc.targets.networkx_export import hag_graph

        hag = self.assembly.hag
        return hag_graph(hag, quantities(hag))

    @property
    def links(self) -> Any:
        """The graph of links and joints of the robot, as a `networkx.MultiDiGraph`.

        The graph is the same in every mode.
        """
        from thingc.targets.networkx_export import link_graph

        return link_graph(self.assembly)

    @property
    def mates(self) -> Any:
        """The graph of all placed components of the robot and the mates between them, as a `networkx.MultiDiGraph`."""
        from thingc.targets.networkx_export import mate_graph

        return mate_graph(self.assembly)

    @property
    def properties(self) -> MassProperties:
        """The mass [kg], the centre of mass [m] and the inertia [kg m^2] of the whole robot at q = 0, in the frame of the base component.

        The inertia is about the centre of mass.
        """
        return self.assembly.properties


def compile(
    document: str,
    *,
    parameters: Mapping[str, str | float] | None = None,
    choices: Mapping[str, str | float] | None = None,
    modes: Sequence[str] = (),
    store: str | None = None,
    jobs: int = 0,
    compat: Iterable[str] | str | None = None,
    strict: bool = False,
    printed: Printed | None = None,
) -> Compiled:
    """Compile an assembly document and return the compiled robot. No files are written except to the cache of parts.

    Args:
        parameters: Values of parameters by name. A value is a string (`{"reach": "120 mm"}`), a number in SI units, or a boolean.
        choices: Other values in the document, by path (`{"components.foot.part": "feet:Wide"}`).
        modes: Names of the modes to compile (by default all).
        store: Folder of the cache of parts (by default the user's cache).
        jobs: Number of parts to build in parallel (0: one per core).
        compat: Programs besides MuJoCo that must be able to read the MuJoCo models (`["mjx"]`; by default the list of the workspace).
        strict: Treat warnings as errors.
        printed: Callback `printed(part, lines)` for text that part classes print when they are built.

    Raises:
        CompileError: The document has errors. The exception contains all diagnostics.
        UnknownChoice: A mode or a program does not exist.
    """
    settings = {**(parameters or {}), **(choices or {})}
    values = {name: value for name, value in settings.items() if not isinstance(value, str)}
    consumers = None if compat is None else pipeline.chosen_consumers(compat)
    texts = [{name: value for name, value in (mapping or {}).items() if isinstance(value, str)} for mapping in (parameters, choices)]
    options = Options(parameters=texts[0], choices=texts[1], store=store, jobs=jobs, printed=printed, compat=consumers)
    return with_environment(document, options, partial(_compile, values=values, modes=modes, strict=strict))


def _compile(environment: Environment, values: Mapping[str, float], modes: Sequence[str], strict: bool) -> Compiled:
    settings = None
    if values:
        from thingc.driver.settings import settings_with

        settings = partial(settings_with, pipeline.settings_of(environment.options), values, environment.report)
    compilation = pipeline.compile(environment, modes, settings=settings)
    _stop_on_errors(compilation.report, strict)
    artifacts = pipeline.build(environment, compilation, ["mjcf"])["mjcf"]
    _stop_on_errors(compilation.report, strict)
    assembly = compilation.assembly
    assert assembly is not None
    files = artifacts.contents(environment.store)
    return Compiled(
        name=assembly.name, assembly=assembly,
        modes={robot.mode.name: CompiledMode(robot=robot, files=files) for robot in compilation.robots},
        diagnostics=tuple(compilation.report.sorted_diagnostics()), modelled=tuple(compilation.modelled), reused=tuple(compilation.reused),
        _page=partial(page_of, pipeline.request_of(environment, compilation)),
    )


def _stop_on_errors(report: Report, strict: bool) -> None:
    checked = report.apply_strict(strict=strict)
    if checked.failed:
        raise CompileError(checked.sorted_diagnostics())
