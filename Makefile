# Head Shop: the commands of the house. Needs python3.11 or python3.13, git and make; everything else goes into $(VENV).
#   make demo       the main job on the embedded sample: out/demo/head.blend, sheet.png, smile.mp4
#   make test       all tests
#   make check      linter and formatter
#   make assets     regenerate the reference head and the muscles' strengths from their generators
#   make sheets     contact sheets of the reference head, out/sheets/*.png
#   make extension  the Blender extension: dist/*.zip, with wheels per platform and one without
#   make bench      benchmarks: ratios against peers measured in the same run
# Another Blender: make test BPY=4.5.15 VENV=.venv-4.5     Another Python: make test PYTHON=python3.13 VENV=.venv-3.13

VENV ?= .venv
BPY ?=
# A name on the PATH may be a shim that does not run: take the first that answers with a Python that has a bpy wheel.
ifeq ($(origin PYTHON),undefined)
PYTHON := $(shell for p in python3.11 python3.13 python3 python; do \
	$$p -c 'import sys; sys.exit(sys.version_info[:2] not in ((3, 11), (3, 13)))' 2>/dev/null && { echo $$p; break; }; done)
endif
PY := $(VENV)/bin/python
READY := $(VENV)/.ready

# A process of tests takes some 2 GB.
SIDE_BY_SIDE := -n auto --maxprocesses 4 --dist worksteal

# Several threads of linear algebra sum in another order: last digits may differ; and beside other processes they are slower.
ONE := OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1

.PHONY: demo test check assets sheets extension bench clean

demo: $(READY)
	$(PY) -m headshop.headshop_addon.demo -o out/demo

test: $(READY)
	$(ONE) $(PY) -m pytest $(SIDE_BY_SIDE) $(ARGS)

check: $(READY)
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .

assets: $(READY)
	$(ONE) $(PY) -m headshop.assets.generators.make_reference_head
	$(ONE) $(PY) -m headshop.assets.generators.make_strengths
	$(ONE) $(PY) -m headshop.assets.generators.make_expression_responses

sheets: $(READY)
	$(PY) -m headshop.assets.generators.sheets out/sheets

extension: $(READY)
	$(PY) packaging/build_extension.py

bench: $(READY)
	$(PY) -m pip install --quiet "trimesh>=4" rtree
	$(PY) benchmarks/adapt.py
	$(PY) benchmarks/tissue.py
	$(PY) benchmarks/frames.py
	$(PY) benchmarks/penetration.py
	$(PY) benchmarks/response.py

$(READY): pyproject.toml
	@test -n "$(PYTHON)" || { echo "Head Shop needs python3.11 or python3.13 on the PATH (or: make PYTHON=/path/to/python)"; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(PY) -m pip install --quiet --disable-pip-version-check -e ".[blender,test]"
	@test -z "$(BPY)" || $(PY) -m pip install --quiet --disable-pip-version-check "bpy==$(BPY)"
	@touch $@

clean:
	rm -rf out build dist *.egg-info .pytest_cache .ruff_cache
