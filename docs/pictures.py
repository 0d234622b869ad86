"""`make pictures`: draw the pictures of the README and the docs with `thingc render`, `thingc hag` and a browser."""

from __future__ import annotations

import base64
import html
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import stock_pictures
import terminal
import website
from PIL import Image

from thingc.tools.templates import TEMPLATES

ROOT = Path(__file__).resolve().parent.parent
PICTURES = ROOT / "docs" / "pictures"
WIDTH, HEIGHT = 640, 480

STRIPS: dict[str, tuple[str, list[list[str]]]] = {
    "arm_modes.png": ("assemblies/arm.yaml", [
        ["--mode", "bench", "--pose", "home", "--azimuth", "150", "--elevation", "-20"],
        ["--mode", "drawing", "--pose", "writing", "--azimuth", "120", "--elevation", "-18"],
        ["--mode", "adrift", "--pose", "stretched", "--azimuth", "120", "--elevation", "-18"],
    ]),
    "minchw_modes.png": ("assemblies/minchw/minchw.yaml", [
        ["--mode", "crawl", "--azimuth", "125"],
        ["--mode", "front_foot_wall", "--pose", "step_rear", "--azimuth", "55", "--elevation", "-8"],
        ["--mode", "rear_foot_ceiling", "--pose", "arched", "--azimuth", "125"],
    ]),
    "new_legged.png": ("compiler/thingc/tools/templates/legged/my_robot.yaml", [
        ["--mode", "walking", "--azimuth", "215"],
        ["--mode", "on_left", "--azimuth", "195", "--elevation", "-10"],
        ["--mode", "on_right", "--azimuth", "165", "--elevation", "-10"],
    ]),
    "gallery_hexapod.png": ("gallery/hexapod/hexapod.yaml", [
        ["--mode", "standing", "--azimuth", "145"], ["--mode", "tripod", "--azimuth", "125"],
    ]),
    "gallery_gripper.png": ("gallery/gripper/gripper.yaml", [
        ["--mode", "bench", "--azimuth", "20"], ["--mode", "dangling", "--azimuth", "60", "--elevation", "-15"],
    ]),
    "gallery_delta.png": ("gallery/delta/delta.yaml", [["--mode", "bench"], ["--mode", "reaching"]]),
    "gallery_balancer.png": ("gallery/balancer/balancer.yaml", [
        ["--mode", "balancing", "--azimuth", "150", "--elevation", "-14"], ["--mode", "fallen", "--azimuth", "150", "--elevation", "-14"],
    ]),
    "gallery_hand.png": ("gallery/hand/hand.yaml", [
        ["--mode", "bench", "--pose", "ok", "--azimuth", "215"], ["--mode", "hanging", "--azimuth", "215"],
    ]),
    "gallery_gecko.png": ("gallery/gecko/gecko.yaml", [["--mode", "floor"], ["--mode", "right_front"]]),
    "gallery_so101.png": ("gallery/so101/so101.yaml", [
        ["--mode", "bench", "--pose", "reaching", "--azimuth", "150"], ["--mode", "hanging", "--azimuth", "215"],
    ]),
    "gallery_dropper.png": ("gallery/dropper/dropper.yaml", [
        ["--mode", "bench", "--azimuth", "60", "--elevation", "-10"],
        ["--mode", "bench", "--pose", "released", "--azimuth", "60", "--elevation", "-10"],
    ]),
    "gallery_biped.png": ("gallery/biped/biped.yaml", [
        ["--mode", "standing", "--azimuth", "145"], ["--mode", "on_one_foot", "--azimuth", "145"],
    ]),
    "gallery_wrist.png": ("gallery/wrist/wrist.yaml", [
        ["--mode", "bench", "--azimuth", "60"], ["--mode", "by_the_hand", "--azimuth", "60"],
    ]),
    "arm_frames.png": ("assemblies/arm.yaml", [["--mode", "drawing", "--joints", "--root", "--mounts-of", "hand.fixture"]]),
}
"""Pictures that are placed side by side: the document, and the options of each."""


def thingc(*words: str) -> str:
    """Return the standard output of a command."""
    command = [sys.executable, "-m", "thingc", *words]
    return subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout


def strip(document: str, shots: list[list[str]]) -> Image.Image:
    """Return pictures of a document side by side."""
    whole = Image.new("RGB", (WIDTH * len(shots), HEIGHT))
    with tempfile.TemporaryDirectory() as folder:
        for index, shot in enumerate(shots):
            path = os.path.join(folder, f"{index}.png")
            thingc("render", document, *shot, "--size", f"{WIDTH}x{HEIGHT}", "-o", path)
            with Image.open(path) as picture:
                whole.paste(picture, (index * WIDTH, 0))
    return whole


def new_robots(path: Path) -> None:
    """Write pictures of the robots of all templates of `thingc new`, side by side."""
    documents = [f"compiler/thingc/tools/templates/{template}/my_robot.yaml" for template in TEMPLATES]
    pictures = [strip(document, [["--azimuth", "215" if "legged" in document else "130"]]) for document in documents]
    whole = Image.new("RGB", (WIDTH * len(pictures), HEIGHT))
    for index, picture in enumerate(pictures):
        whole.paste(picture, (index * WIDTH, 0))
    whole.resize((whole.width // 2, HEIGHT // 2)).save(path, optimize=True)


def batch_page(path: Path) -> None:
    """Write a screenshot of the page of a batch with a selected variant."""
    browser = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if browser is None:
        print("no Chromium is installed: the picture of a batch's page stays as it is", file=sys.stderr)
        return
    with tempfile.TemporaryDirectory() as folder:
        thingc("batch", "assemblies/minchw/sizes.yaml", "-o", folder, "--pictures", "all")
        lines = (Path(folder) / "sizes" / "results.csv").read_text().splitlines()
        id = lines[9].split(",")[1]
        page = (Path(folder) / "sizes" / "index.html").as_uri()
        words = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--window-size=1400,1000"]
        words += ["--virtual-time-budget=3000", f"--user-data-dir={folder}/profile", f"--screenshot={path}", f"{page}#{id}"]
        subprocess.run([browser, *words], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    with Image.open(path) as picture:
        picture.convert("RGB").save(path, optimize=True)


HERO = (
    ("front_foot", "step_rear", (0.95, -0.62, 0.5)), ("front_foot_wall", "arched", (-0.55, -1.05, 0.3)),
    ("rear_foot_ceiling", "arched", (0.95, -0.7, -0.2)),
)
"""Modes of MInchW, each with a pose and the position of the camera."""


def hero(path: Path) -> None:
    """Write the modes of MInchW in its document, next to the modes in the viewer."""
    from viewer.browser import BROWSER, address, chromium, drawn, opened

    if BROWSER is None:
        print("no Chromium is installed: the first picture of the README stays as it is", file=sys.stderr)
        return
    document = (ROOT / "assemblies/minchw/minchw.yaml").read_text().splitlines()
    start = document.index("modes:")
    wanted = ("  front_foot:", "  rear_foot:", "  front_foot_wall:", "  rear_foot_ceiling:")
    lines, keeping = ["modes:"], False
    for line in document[start + 1 : document.index("sensors:")]:
        if line.startswith("  ") and not line.startswith("   "):
            keeping = line.startswith(wanted) and not line.startswith("  #")
        if keeping:
            lines.append(line.partition("  #")[0].rstrip())
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        thingc("build", "assemblies/minchw/minchw.yaml", "-o", folder, "--emit", "html")
        page = Path(folder) / "minchw/html/minchw.html"
        shots: list[str] = []
        for mode, pose, eye in HERO:
            with opened(browser, address(page, f"#mode={mode}&pose={pose}&theme=light&panels=none&marks=floor"), (400, 711)) as shown:
                shown.evaluate("(eye) => thingc.viewer.reset(eye)", eye)
                drawn(shown)
                picture = base64.b64encode(shown.locator("#view").screenshot()).decode()
            shots.append(f'<figure><img src="data:image/png;base64,{picture}"><figcaption>{mode}</figcaption></figure>')
        both = Path(folder) / "hero.html"
        both.write_text(FRAME.replace("@TEXT@", html.escape("\n".join(lines))).replace("@SHOTS@", "".join(shots)))
        steered = browser.new_page(viewport={"width": 1460, "height": 480}, device_scale_factor=1.5)
        steered.goto(both.as_uri())
        steered.locator("main").screenshot(path=str(path))
    with Image.open(path) as picture:
        picture.convert("RGB").quantize(255, kmeans=3, dither=Image.Dither.NONE).save(path, optimize=True)


STEPS = {
    "rover": {"start_left.png": "mode=on_left&pose=lean_left"}, "rover_longer": {"start_longer.png": "mode=walking"},
    "rover_hat": {"start_hat.png": "mode=walking", "start_margin.png": "mode=on_left&pose=lean_left&colour=torque+margin"},
}
"""Pictures of the first tutorial: the step, and the permalink of the viewer."""


def tutorial() -> None:
    """Write pictures of the tutorial's robot after each step, in the viewer."""
    from viewer.browser import BROWSER, address, chromium, drawn, opened

    if BROWSER is None:
        print("no Chromium is installed: the pictures of the tutorial stay as they are", file=sys.stderr)
        return
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        for name, document in website.made((ROOT / "docs/start.md").read_text(), Path(folder)):
            page = Path(folder) / f"{name}.html"
            website.view(document, page)
            for picture, where in STEPS[name].items():
                with opened(browser, address(page, f"#{where}&theme=light&panels=none&marks=floor"), (960, 420)) as shown:
                    drawn(shown)
                    shown.locator("#view").screenshot(path=str(PICTURES / picture))


FRAME = """<!doctype html><meta charset="utf-8"><style>
  body { margin: 0; font: 15px system-ui, "DejaVu Sans", sans-serif; }
  main { display: flex; width: 1460px; height: 480px; background: #fff; }
  pre { margin: 0; padding: 20px 22px; width: 500px; flex: none; background: #1d242c; color: #e9edf1; overflow: hidden;
    font: 14px/1.6 "DejaVu Sans Mono", monospace; }
  figure { position: relative; margin: 0; flex: 1; border-left: 1px solid #dde3e9; overflow: hidden; }
  img { width: 100%; height: 100%; object-fit: cover; display: block; }
  figcaption { position: absolute; left: 14px; bottom: 12px; padding: 2px 12px; border-radius: 99px; background: #1f6498; color: #fff;
    font-weight: 600; }
</style><main><pre>@TEXT@</pre>@SHOTS@</main>"""


def search_front(path: Path) -> None:
    """Write the Pareto front that the example of a page draws."""
    from docs.pages import blocks

    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "thingc.toml").write_text('thingc = "workspace/1"\n')
        for block in blocks(ROOT / "docs" / "variants_search.md"):
            if block.file is not None:
                (Path(folder) / block.file).write_text(block.text)
        subprocess.run([sys.executable, "front.py"], cwd=folder, check=True)
        shutil.copy(Path(folder) / "front.png", path)


def main() -> int:
    """Write all pictures."""
    PICTURES.mkdir(exist_ok=True)
    sys.path.insert(0, str(ROOT / "tests"))
    hero(PICTURES / "hero.png")
    terminal.write(PICTURES / "terminal.svg")
    for name, (document, shots) in STRIPS.items():
        strip(document, shots).save(PICTURES / name, optimize=True)
    new_robots(PICTURES / "new_robots.png")
    batch_page(PICTURES / "batch_page.png")
    search_front(PICTURES / "search_front.png")
    tutorial()
    stock_pictures.write(PICTURES)
    (PICTURES / "arm_hag.svg").write_text(thingc("hag", "assemblies/arm.yaml", "--format", "svg"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
