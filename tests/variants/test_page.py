"""The page of a batch in a real browser. A script is added to a copy of the page. It uses the page like a person, and leaves its
observations in the document. Without Chromium, these tests are skipped."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import unquote

import psutil
import pytest
from PIL import Image

from conformance.harness import thingc_here
from thingc.base.diagnostics import Code
from thingc.batch import folder_layout
from thingc.batch.page import write_page
from thingc.batch.pictures import along_the_axes, draw, usual
from thingc.batch.tables import Column, columns
from variants.robots import batch_here, environment, workspace
from viewer.browser import chromium, needed

pytestmark = pytest.mark.slow

HARNESS = """
<script>
window.faults = [];
window.addEventListener("error", (event) => window.faults.push(String(event.message ?? (event.target && event.target.src))), true);
window.addEventListener("securitypolicyviolation", (event) => window.faults.push(event.violatedDirective + " " + event.blockedURI));
console.error = (...words) => window.faults.push(words.join(" "));
</script>
"""


Using = Callable[[Path, str], dict[str, object]]


@pytest.fixture(scope="module")
def seen() -> Iterator[Using]:
    """Run a program (the body of a function) in a page. Return its result, and a list `faults` of all errors."""
    with chromium() as steered:
        context = steered.new_context()
        context.new_page()  # with the last page of a context its process would end

        def use(page: Path, program: str) -> dict[str, object]:
            copy = page.with_name("tried.html")
            copy.write_text(page.read_text().replace("<head>", "<head>" + HARNESS, 1).replace("</body>", used_by(program) + "</body>"))
            tab = context.new_page()
            tab.goto(copy.as_uri())
            found: dict[str, object] = json.loads(unquote(tab.locator("#found").text_content()))
            tab.close()
            copy.unlink()
            return found

        yield use


def used_by(program: str) -> str:
    """Return a script that uses the page like a person, and leaves its observations in the document."""
    return f"""<script>
      window.addEventListener("load", () => {{
        const $ = (selector) => document.querySelector(selector), all = (selector) => [...document.querySelectorAll(selector)];
        const type = (selector, value) => {{
          const e = $(selector);
          e.value = value;
          e.dispatchEvent(new Event(e.tagName === "SELECT" ? "change" : "input"));
        }};
        const names = () => all("#grid .card .name span:last-child, #bare .line .name").map((e) => e.textContent);
        let found;
        try {{ found = (() => {{ {program} }})(); }} catch (fault) {{ found = {{}}; window.faults.push(String(fault.stack)); }}
        const out = document.createElement("pre");
        out.id = "found";
        out.textContent = encodeURIComponent(JSON.stringify({{ ...found, faults: window.faults }}));
        document.body.append(out);
      }});
    </script>"""


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "results.csv").open() as stream:
        return list(csv.DictReader(stream))


STANDS = """
    thingc: variants/1
    assembly: stand.yaml
    name: stands
    parameters: {side: {from: 30 mm, to: 80 mm, count: 6}}
    choices:
      components.plate.material: [light, heavy]
    keep: ["side < 75 mm", "mass < 200 g"]
"""


@pytest.fixture(scope="module")
def stands(tmp_path_factory: pytest.TempPathFactory, shared_store: str) -> Path:
    """The folder of a batch with pictures: 12 variants, of which some are excluded."""
    here = workspace(tmp_path_factory.mktemp("page"), stands=STANDS)
    done = batch_here("stands.yaml", "--pictures", "3", "--jobs", "1", cwd=here, env=environment(shared_store))
    assert done.returncode == 0, done.stderr
    return here / "build" / "stands"


def test_pictures_have_one_camera(stands: Path) -> None:
    built = [row for row in table(stands) if row["status"] == "built"]
    pictures = sorted(path.name for path in (stands / "pictures").iterdir())
    assert len(built) == 9 and len(pictures) == 3 and set(pictures) <= {f"{row['id']}.png" for row in built}
    widths = {}
    for row in built:
        path = stands / "pictures" / f"{row['id']}.png"
        if path.exists():
            with Image.open(path) as image:
                assert image.size == (240, 180)
                dark = image.convert("L").point(lambda value: 255 if value < 110 else 0).getbbox()
            widths[float(row["parameters.side"]), row["components.plate.material"]] = 0 if dark is None else dark[2] - dark[0]
    by_side = [width for _, width in sorted(widths.items())]
    assert by_side == sorted(by_side) and by_side[-1] > 1.3 * by_side[0]  # the larger plate is larger in its picture


def test_page_is_reproducible(stands: Path, shared_store: str) -> None:
    before = (stands / "index.html").read_bytes()
    pictures = {path.name: path.read_bytes() for path in (stands / "pictures").iterdir()}
    (stands / "index.html").unlink()
    done = thingc_here("batch", "stands.yaml", "--page-only", "--pictures", "3", cwd=stands.parents[1], store=shared_store)
    assert done.code == 0 and done.err == "build/stands/index.html\n" and done.out == ""
    assert (stands / "index.html").read_bytes() == before
    assert {path.name: path.read_bytes() for path in (stands / "pictures").iterdir()} == pictures


def test_killed_renderer_is_reported(stands: Path, tmp_path: Path) -> None:
    """Existing pictures stay."""
    folder = tmp_path / "stands"
    shutil.copytree(stands, folder)

    def kill(done: int, count: int) -> None:
        for child in psutil.Process().children():
            if "thingc.batch.thumbnails" in child.cmdline():
                child.kill()

    warning = draw(str(folder), "default", None, max_pictures=3, on_picture=kill)
    assert warning is not None and warning.code is Code.NO_GRAPHICS
    assert warning.message == (
        "pictures are missing on the page of the batch: the rendering process failed: it was terminated by SIGKILL"
    )
    assert [path for path in (folder / "pictures").iterdir() if path.suffix != ".png"] == []


def test_page_sends_no_requests(stands: Path) -> None:
    text = (stands / "index.html").read_text()
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)", text)
    assert not re.search(r"""(src|href)=["'](?!data:)""", text)


@needed
def test_sorting_filtering_and_selecting(stands: Path, seen: Using) -> None:
    found = seen(stands / "index.html", """
        const first = names();
        type("#sort", "mass");
        const light = names();
        $("#direction").click();
        const heavy = names();
        type("#filter", "side>45 components.plate.material=heavy");
        const filtered = names(), said = $("#said").textContent;
        type("#filter", "colour>3");
        const wrong = $("#said").textContent;
        type("#filter", "");
        $("[data-status=kept_out]").click();
        const built = names();
        $("#view-table").click();
        const heads = all("#rows th").map((e) => e.dataset.column), cells = all("#rows tbody tr").map((e) => e.children[0].textContent);
        $("#rows th[data-column=name]").click();
        const byName = all("#rows tbody tr").map((e) => e.children[0].textContent);
        $("#rows tbody tr").click();
        return { first, light, heavy, filtered, said, wrong, built, heads, cells, byName, one: $("#one h2").textContent,
          command: $("#one code").textContent, image: all("#grid img").length, title: document.title };
    """)
    assert found["faults"] == []
    rows = table(stands)
    with_pictures = {path.stem for path in (stands / "pictures").iterdir()}
    rows.sort(key=lambda row: row["id"] not in with_pictures)  # those without one come after, as lines
    assert found["first"] == [row["name"] for row in rows]
    massed = sorted((row for row in rows if row["mass"]), key=lambda row: float(row["mass"]))
    drawn, others = ([row["name"] for row in massed if (row["id"] in with_pictures) == wanted] for wanted in (True, False))
    without = [row["name"] for row in rows if not row["mass"]]
    assert found["light"] == [*drawn, *others, *without]
    assert found["heavy"] == [*reversed(drawn), *reversed(others), *without]
    wanted = {row["name"] for row in rows if float(row["parameters.side"]) > 0.045 and row["components.plate.material"] == "heavy"}
    assert set(found["filtered"]) == wanted and found["said"] == f"{len(wanted)} of 12 variants"  # type: ignore[call-overload]
    assert found["wrong"] == "there is no column colour"
    built = [row["name"] for row in reversed(massed) if row["status"] == "built"]
    assert found["cells"] == built and set(found["built"]) == set(built) and found["byName"] == sorted(built)
    assert {"name", "parameters.side", "components.plate.material", "mass"} <= set(found["heads"])  # type: ignore[call-overload]
    assert found["one"] == sorted(built)[0]
    assert found["command"] == next(row["command"] for row in rows if row["name"] == found["one"])


@needed
def test_values_have_units_and_other_variants_are_collapsed(stands: Path, seen: Using) -> None:
    found = seen(stands / "index.html", """
        const bare = $("#bare"), cards = all(".card").map((e) => e.textContent), lines = all("#bare .line").map((e) => e.textContent);
        const said = $("#bare summary").textContent, open = bare.open;
        type("#plot-x", "parameters.side");
        const title = all("#chart .title").map((e) => e.textContent);
        $("#view-table").click();
        return { cards, lines, said, open, title, units: all("#rows th small").map((e) => e.textContent), hidden: bare.hidden,
          sides: all("#rows tbody tr").map((e) => e.textContent.match(/(\\d+)(light|heavy)/)?.[1]) };
    """)
    assert found["faults"] == [] and found["open"] is False and found["hidden"] is True
    assert len(found["cards"]) == 3 and all(re.search("side[3-7]0 mm", card) for card in found["cards"])  # type: ignore[arg-type, attr-defined]
    assert found["said"] == "9 without a picture: 6 built, 3 excluded" and len(found["lines"]) == 9  # type: ignore[arg-type]
    assert sum("excluded: " in line for line in found["lines"]) == 3  # type: ignore[attr-defined]
    assert "side [mm]" in found["title"] and found["units"][0] == "mm"  # type: ignore[operator, index]
    assert set(found["sides"]) == {"30", "40", "50", "60", "70", "80"}  # type: ignore[call-overload]


def test_pictures_show_variants_along_the_axes() -> None:
    """In a grid of 9 x 5 x 2 variants, the pictures are on a line along each axis through the middle, with both ends. A setting that
    repeats another one is not an axis."""
    grid = [(x, x * 2.0, y, z) for x in range(9) for y in (0.1, 0.2, 0.3, 0.4, 0.5) for z in ("a", "b")]
    found = [grid[k] for k in along_the_axes(grid, 14)]
    assert len(set(found)) == 14 and found == sorted(found)
    first = [x for x, _, y, _ in found if y == 0.3]
    assert {0, 2, 4, 6, 8} <= set(first)
    assert {0.1, 0.2, 0.3, 0.4, 0.5} == {y for x, _, y, _ in found if x == 4}
    assert {z for *_, z in found} == {"a", "b"}
    assert along_the_axes([(1,), (1,), (1,), (1,)], 2) == [0, 2]


def test_large_batches_have_no_pictures_by_default(tmp_path: Path, shared_store: str) -> None:
    assert [usual(count) for count in (1, 48, 200, 201, 50_000)] == [48, 48, 48, 0, 0]
    many = "thingc: variants/1\nassembly: pendulum.yaml\nname: many\nparameters: {length: {from: 200 mm, to: 400 mm, count: 201}}\n"
    here = workspace(tmp_path, many=many + "keep: [length < 202 mm]\n")
    done = batch_here("many.yaml", "--verify", "none", "--jobs", "1", cwd=here, env=environment(shared_store))
    words = "to draw pictures on the page, run: "
    words += "thingc batch many.yaml --page-only --pictures 48\n"
    assert done.returncode == 0 and done.stderr.endswith(words), done.stderr
    without = batch_here("many.yaml", "--verify", "none", "--jobs", "1", "--pictures", "none", cwd=here, env=environment(shared_store))
    assert without.returncode == 0 and words not in without.stderr


@needed
def test_plot(stands: Path, seen: Using) -> None:
    clicked = min(path.stem for path in (stands / "pictures").iterdir())
    found = seen(stands / "index.html", """
        type("#plot-x", "parameters.side"); type("#plot-y", "mass"); type("#plot-colour", "components.plate.material");
        const points = all("#chart circle").map(
          (e) => [e.dataset.id, Number(e.getAttribute("cx")), Number(e.getAttribute("cy")), e.style.stroke || e.style.fill,
            e.style.fill === "rgb(255, 255, 255)"]);
        const legend = all("#legend span").map((e) => e.textContent);
        $('#chart circle[data-id="CLICKED"]').dispatchEvent(new MouseEvent("click", { bubbles: true }));
        return { points, legend, one: $("#one h2").textContent, chosen: all(".card.chosen").length, ticks: all("#chart text").length };
    """.replace("CLICKED", clicked))
    assert found["faults"] == []
    rows = {row["id"]: row for row in table(stands)}
    points: list[tuple[str, float, float, str, bool]] = found["points"]  # type: ignore[assignment]
    assert {point[0] for point in points} == {id for id, row in rows.items() if row["mass"]}
    side, mass = ([float(rows[point[0]][name]) for point in points] for name in ("parameters.side", "mass"))
    for values, places_, sign in ((side, [p[1] for p in points], 1.0), (mass, [p[2] for p in points], -1.0)):  # linear, up is less y
        low, high = min(values), max(values)
        at_low, at_high = places_[values.index(low)], places_[values.index(high)]
        assert sign * (at_high - at_low) > 100.0
        for value, place in zip(values, places_, strict=True):
            assert place == pytest.approx(at_low + (value - low) / (high - low) * (at_high - at_low), abs=0.15)
    colours = {rows[p[0]]["components.plate.material"]: p[3] for p in points}
    assert len(set(colours.values())) == 2 and all(colours[rows[p[0]]["components.plate.material"]] == p[3] for p in points)
    assert found["legend"][:2] == ["heavy", "light"] and "without a value" in found["legend"][-1]  # type: ignore[index]
    assert {p[0] for p in points if p[4]} == {id for id, row in rows.items() if row["mass"] and row["status"] != "built"}
    assert found["one"] == rows[clicked]["name"] and found["chosen"] == 1


NASTY = [
    '</script><script>window.faults.push("broken out")</script>', "<img src=x onerror='window.faults.push(1)'>", "a&b<c>\"d'",
    "@STYLE@ @SCRIPT@ @DATA@", "line\u2028sep\u2029", "right\u202eleft", "{{7*7}} ${7*7} \\u003c",
]


def made(folder: Path, count: int, text: str = "plain") -> tuple[Path, list[Column]]:
    """Create a page with this number of rows from a journal, with `text` in all values that a document or a part can contain."""
    folder.mkdir(parents=True)
    wanted = list(columns([Column(name="length", kind="number", unit="m"), Column(name="label", kind="text")], [], []))
    with (folder / folder_layout.JOURNAL).open("w") as stream:
        for index in range(count):
            stream.write(json.dumps({
                "index": index, "id": f"{index:012x}", "name": f"{text} {index}", "status": "refused" if index % 3 == 2 else "built",
                "code": "TC000", "message": text, "rule": text, "choices": {},
                "parameters": {"length": index / 7.0, "label": text + str(index % 2)},
                "results": {"mass": (index * 7919) % 1009 + 0.5, "torque_margin": "inf"}, "path": text, "command": text, "seconds": index,
            }) + "\n")
    described = {
        "name": text, "document": text, "assembly": text, "count": count, "modes": [text], "pose": text, "finished": True,
        "layout": "folders",
    }
    return Path(write_page(str(folder), described, wanted)), wanted


@needed
@pytest.mark.parametrize("text", NASTY, ids=range(len(NASTY)))
def test_texts_of_documents_are_escaped(tmp_path: Path, text: str, seen: Using) -> None:
    page, _ = made(tmp_path / "batch", 6, text)
    found = seen(page, """
        $("#view-table").click();
        $("#every").click();
        $("#rows tbody tr").click();
        type("#plot-colour", "parameters.label");
        return { title: $("#title").textContent, name: $("#one h2").textContent, command: $("#one code").textContent,
          scripts: all("script").length, images: all("img").length,
          message: all("#rows td").some((e) => e.textContent === $("#title").textContent) };
    """)
    text = text.replace("\u2028", "\\u2028").replace("\u2029", "\\u2029").replace("\u202e", "\\u202e")  # shown, not obeyed
    assert found == {"faults": [], "title": text, "name": f"{text} 0", "command": text, "scripts": 4, "images": 0, "message": True}


@needed
def test_ten_thousand_rows_stay_usable(tmp_path: Path, seen: Using) -> None:
    page, _ = made(tmp_path / "batch", 10_000)
    found = seen(page, """
        const begun = performance.now();
        type("#sort", "mass");
        type("#filter", "mass>500 status=built");
        const spent = performance.now() - begun, shown = all("#rows tbody tr").length, said = $("#said").textContent;
        $("#next").click();
        return { spent, shown, said, none: $("#view-pictures").disabled, pages: $("#pages span").textContent,
          points: all("#chart circle").length };
    """)
    masses = [(index * 7919) % 1009 + 0.5 for index in range(10_000) if index % 3 != 2]
    count = sum(mass > 500 for mass in masses)
    assert found["faults"] == [] and found["shown"] == 200 and found["none"] is True
    assert found["said"] == f"{count} of 10000 variants" and found["pages"] == f"201 to 400 of {count}"
    assert found["points"] == count and float(found["spent"]) < 5000.0  # type: ignore[arg-type]


def test_page_does_not_depend_on_the_run(tmp_path: Path) -> None:
    page, _ = made(tmp_path / "batch", 3)
    assert "seconds" not in page.read_text().split('id="batch"')[1].split("</script>")[0]


def test_robots_of_frames_have_a_page_without_pictures(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path)
    done = batch_here("sweep.yaml", "--jobs", "1", cwd=here, env=environment(shared_store))
    assert done.returncode == 0 and (here / "build/sweep/index.html").is_file() and not (here / "build/sweep/pictures").exists()
    assert "warning" not in done.stderr


@needed
def test_cards_show_the_number_of_omitted_values(tmp_path: Path, shared_store: str, seen: Using) -> None:
    """Two cards can show the same values if only their omitted values differ."""
    both = [f"materials.{name}.{key}" for key in ("friction.slide", "density") for name in ("light", "heavy")]
    paths = ["side", "simulation.timestep", *both]
    listed = "".join(
        f"\n      - parameters: {json.dumps(dict(zip(paths, values, strict=True)))}"
        for values in (
            ["40 mm", "1 ms", 0.5, 0.6, "500 kg/m^3", "600 kg/m^3"], ["50 mm", "2 ms", 0.7, 0.8, "700 kg/m^3", "800 kg/m^3"],
        )
    )
    here = workspace(tmp_path, several=f"""
    thingc: variants/1
    assembly: stand.yaml
    name: several
    list: {listed}
    """)
    done = batch_here("several.yaml", "--pictures", "2", "--jobs", "1", cwd=here, env=environment(shared_store))
    assert done.returncode == 0, done.stdout + done.stderr
    found = seen(here / "build/several/index.html", """
        return { told: [...$("#grid .card dl").querySelectorAll("dt")].map((e) => e.textContent) };
    """)
    assert found == {"faults": [], "told": [
        "side", "simulation.timestep", "materials.light.friction.slide", "materials.heavy.friction.slide", "materials.light.density",
        "and 1 more",
    ]}


def test_page_without_graphics(stands: Path, tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path, stands=STANDS)
    env = {**environment(shared_store), "MUJOCO_GL": "nonsense"}
    done = batch_here("stands.yaml", "--verify", "none", "--jobs", "1", cwd=here, env=env)
    assert done.returncode == 0 and "warning[TC808]" in done.stderr and "Traceback" not in done.stderr, done.stderr
    assert (here / "build/stands/index.html").is_file() and not os.path.exists(here / "build/stands/pictures")


def test_page_only_needs_a_batch(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path)
    done = thingc_here("batch", "sweep.yaml", "--page-only", cwd=here, store=shared_store)
    assert done.code == 2 and "error[TC924]" in done.err and not (here / "build").exists()
    wrong = thingc_here("batch", "sweep.yaml", "--pictures", "some", cwd=here, store=shared_store)
    assert wrong.code == 2 and "expected a whole number of at least 1, `none` or `all`, found `some`" in wrong.err
