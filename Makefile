# make demo: a fresh Debian/Ubuntu machine to renders/demo.mp4.  make test: the same machine to passed tests.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test gl clean

demo: $(VENV)/.installed gl
	$(BIN)/commhg-mj run --scenario medium --policy greedy --seed 7 --out renders/.demo
	$(BIN)/commhg-mj render renders/.demo/medium-greedy-7.npz --out renders/demo.mp4 --speed 40
	@echo "watch renders/demo.mp4"

test: $(VENV)/.tested gl
	$(BIN)/python -m pyrefly check --python-interpreter-path $(BIN)/python
	$(BIN)/python -m pytest -n 2 -q

gl:
	@sh scripts/ensure_gl.sh

$(VENV)/.installed: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys, ensurepip; assert sys.version_info >= (3, 11)' || \
		{ echo "Python 3.11 or newer with venv is needed: apt-get install python3 python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -q --upgrade pip
	$(BIN)/python -m pip install -q -c constraints.txt -e .
	$(BIN)/python -m pip install -q -c constraints.txt --no-deps dm_control  # which requires what Python 3.13 cannot have
	touch $@

$(VENV)/.tested: $(VENV)/.installed
	$(BIN)/python -m pip install -q -c constraints.txt -e '.[test]'
	touch $@

clean:
	rm -rf $(VENV)
