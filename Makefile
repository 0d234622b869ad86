# `make demo` and `make test` only need Python 3.11+ and make. They create .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# For two cores. Many tests wait for processes, so that three of them leave a tenth of the cores idle.
JOBS ?= 4

.PHONY: demo test lint same bench bench-naming bench-step bench-designs bench-variants bench-viewer gradients conformance bench-weld print-masses walk climb plan bridge-search codesign mutants mutation slips fuzz kills docs site pictures viewer constraints release wheel notebook image-steps test-pythons freeze frozen structure clean

demo: $(VENV)/.thingc
	$(BIN)/thingc build assemblies/arm.yaml
	@echo
	@echo "The arm is in build/arm:"
	@echo "  build/arm/mjcf/scene_bench.xml    look at it:  $(BIN)/python -m mujoco.viewer --mjcf=build/arm/mjcf/scene_bench.xml"
	@echo "  build/arm/mjcf/arm_<mode>.xml     one MuJoCo model per mode: bench, drawing, adrift"
	@echo "  build/arm/stl/                    one print file per printed part (millimetres)"
	@echo "  build/arm/step/arm.step           the whole robot for any CAD program"
	@echo "  build/arm/bom.csv                 what to buy and print"
	@echo "  build/arm/hag.svg                 its assembly graph"

# mypy runs beside the tests, on whatever core is free. In a new checkout, pytest first compiles all tests once; otherwise, each worker
# would compile them.
test: $(VENV)/.thingc-dev
	$(BIN)/ruff check .
	$(BIN)/mypy & types=$$!; test -d tests/__pycache__ || $(BIN)/pytest --collect-only -qq > /dev/null; \
	$(BIN)/pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder; tests=$$?; wait $$types && exit $$tests

lint: $(VENV)/.thingc-dev
	$(BIN)/ruff check .
	$(BIN)/mypy

bench: $(VENV)/.thingc-dev
	$(BIN)/python benchmarks/run.py

bench-weld: $(VENV)/.thingc-dev
	$(BIN)/python benchmarks/weld_vs_root/study.py

print-masses: $(VENV)/.thingc-dev
	$(BIN)/python benchmarks/prints/print_masses.py

walk: $(VENV)/.thingc-dev
	$(BIN)/python examples/walk.py --gif docs/pictures/minchw_walk.gif --page docs/studies/walking.md

climb: $(VENV)/.thingc-dev
	$(BIN)/python examples/climb.py --film docs/pictures/minchw_climb.webp --plot docs/pictures/minchw_speeds.png --page docs/studies/walking.md

plan: $(VENV)/.thingc-dev
	$(BIN)/python examples/plan_climb.py --picture docs/pictures/minchw_plan.png --page docs/studies/planning.md

bridge-search: $(VENV)/.thingc-dev
	$(BIN)/python examples/longest_bridge.py --docs docs

codesign: $(VENV)/.thingc-dev
	$(BIN)/python examples/codesign.py --plot docs/pictures/codesign.png --page docs/studies/codesign.md

bench-variants: $(VENV)/.thingc-dev
	$(BIN)/python benchmarks/variants/throughput.py --scale 10000
	$(BIN)/python benchmarks/variants/memory.py --scale 100000
	$(BIN)/python benchmarks/variants/patched.py
	$(BIN)/python benchmarks/variants/patched.py --parts --count 300
	$(BIN)/python benchmarks/variants/parallel.py
	$(BIN)/python benchmarks/variants/beside.py
	$(BIN)/python benchmarks/variants/cluster.py
	$(BIN)/python benchmarks/variants/packed.py
	$(BIN)/python benchmarks/variants/equal.py
	$(BIN)/python benchmarks/variants/equal.py --layout packed --count 60

gradients: $(VENV)/.thingc-dev
	$(BIN)/python benchmarks/variants/gradients.py
	$(BIN)/python benchmarks/variants/switches.py

bench-viewer: $(VENV)/.thingc-dev
	$(BIN)/python benchmarks/viewer/study.py

mutants: $(VENV)/.thingc-dev
	$(BIN)/python benchmarks/mutants/study.py

MUTANTS ?= 300

mutation: $(VENV)/.thingc-dev
	$(BIN)/python benchmarks/mutation/campaign.py --number $(MUTANTS) --seed $(SEED)

slips: $(VENV)/.thingc-dev
	$(BIN)/python benchmarks/mutants/slipping.py

bench-naming: $(VENV)/.thingc-dev
	$(BIN)/python benchmarks/naming/study.py

bench-step: $(VENV)/.thingc-dev
	$(BIN)/python benchmarks/step/study.py assemblies/arm.yaml assemblies/minchw/minchw.yaml

# `CHECKERS="NAME ..."` only runs these checkers of other projects.
conformance: $(VENV)/.thingc-dev
	$(BIN)/python benchmarks/conformance/checkers.py $(CHECKERS)
ifndef CHECKERS
	$(BIN)/python benchmarks/conformance/study.py
	$(BIN)/python benchmarks/variants/worlds.py
endif

bench-designs: $(VENV)/.thingc-dev
	$(BIN)/python benchmarks/designs/study.py

ONLY ?= *

freeze: $(VENV)/.thingc-dev
	$(BIN)/python benchmarks/corpus.py freeze build/corpus.json --only $(patsubst %,'%',$(ONLY))

frozen: $(VENV)/.thingc-dev
	$(BIN)/python benchmarks/corpus.py compare build/corpus.json --only $(patsubst %,'%',$(ONLY))

# `SINCE=REVISION` adds the figures of another revision.
structure: $(VENV)/.thingc-dev
	$(BIN)/python benchmarks/structure/figures.py $(SINCE)

MINUTES ?= 30

fuzz: $(VENV)/.thingc-dev
	$(BIN)/thingc lock
	$(BIN)/python tests/fuzz/fuzz.py --minutes $(MINUTES) --lock parts.lock.json --keep build/fuzz

DISGUISES ?= 1000

# `ROBOTS=DIR` uses all robots below a folder.
same: $(VENV)/.thingc-dev
	$(BIN)/python tests/same/study.py --number $(DISGUISES) --robots '$(ROBOTS)'

KILLS ?= 60
SEED ?= 1

kills: $(VENV)/.thingc-dev
	$(BIN)/python tests/conformance/kills.py --number $(KILLS) --seed $(SEED)

$(VENV)/.thingc: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@echo "installing into $(VENV), which takes a minute or so"
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	touch $@

$(VENV)/.thingc-dev: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@echo "installing into $(VENV), which takes a minute or so"
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable ".[dev]"
	touch $@ $(VENV)/.thingc

docs: $(VENV)/.thingc-dev
	$(BIN)/python docs/generate.py
	$(BIN)/python docs/mate_picture.py
	$(BIN)/python docs/motion_picture.py
	$(BIN)/python docs/concept_pictures.py

# The documentation as a website with viewers: build/site/index.html
site: $(VENV)/.thingc-dev
	$(BIN)/python docs/website.py

pictures: $(VENV)/.thingc-dev
	$(BIN)/python docs/pictures.py

# Requires Node.js and npm. The result is committed, so only changes of the viewer require them.
viewer:
	cd viewer && npm ci --no-audit --no-fund && npm run build

# The versions that the GitHub Action installs. Requires uv.
constraints:
	uv pip compile pyproject.toml --universal --python-version 3.11 --no-annotate --upgrade --quiet --custom-compile-command "make constraints" -o gate/constraints.txt

# The files of a release, in dist/: sdist, wheel, and the CycloneDX bills of materials of Python and of the viewer's JavaScript. Requires npm.
release wheel test-pythons notebook: export SOURCE_DATE_EPOCH ?= $(shell git log -1 --format=%ct)
release: $(VENV)/.thingc-dev
	rm -rf dist
	$(BIN)/python -m pip install --quiet --disable-pip-version-check cyclonedx-bom
	$(BIN)/python -m build --outdir dist
	$(BIN)/cyclonedx-py requirements gate/constraints.txt --pyproject pyproject.toml --output-reproducible -o dist/thingc.cdx.json
	cd viewer && npm sbom --omit dev --package-lock-only --sbom-format cyclonedx > ../dist/thingc-viewer.cdx.json

# Install the wheel and the sdist with all dependencies in new environments, and build a robot with each. Requires uv.
wheel: $(VENV)/.thingc-dev
	$(BIN)/python -m build --outdir dist
	$(BIN)/python packaging/pythons.py --sdist --no-tests

PYTHONS ?= 3.11 3.12 3.13 3.14

# Install the wheel for each version of Python, build a robot, and run some tests. Requires uv, which downloads missing interpreters.
test-pythons: $(VENV)/.thingc-dev
	$(BIN)/python -m build --outdir dist
	$(BIN)/python packaging/pythons.py --python $(PYTHONS)

# Execute the notebook in a new environment, in which it installs the wheel. Requires uv.
notebook: $(VENV)/.thingc-dev
	$(BIN)/python -m build --outdir dist
	$(BIN)/python packaging/notebook.py

# Run the steps of the Dockerfile in a new Debian system, without Docker. Requires root, debootstrap and a wheel in dist/.
image-steps: $(VENV)/.thingc-dev
	$(BIN)/python packaging/image_steps.py

clean:
	rm -rf build dist .pytest_cache .mypy_cache .ruff_cache
