"""Machine code is cached, never outlives a change of its sources, and is not needed."""

import compileall
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import systems
from planners import split_edges

USES_CACHE = "print(kernels.total(1.0), sum(kernels.total.stats.cache_hits.values()))"


class Library:
    """A copy of the library's package, with a constant and two compiled modules of its own."""

    def __init__(self, root):
        self.root = root
        self.package = root / "systems"
        self.package.mkdir(parents=True)
        for name in ("__init__.py", "__init__.pyi", "compilation.py"):
            shutil.copy(Path(systems.__file__).with_name(name), self.package)
        # In place of the one that asks for the other packages.
        (root / "_transition_reliability.py").touch()
        self.write("lengths", "LENGTH = 2.0\n")
        self.write(
            "inner_kernels",
            "from systems.compilation import compiled\n"
            "from systems.lengths import LENGTH\n"
            "@compiled(inline='always')\n"
            "def stretched(x):\n"
            "    return x * LENGTH\n",
        )
        self.write(
            "kernels",
            "from systems.compilation import compiled\n"
            "from systems.inner_kernels import stretched\n"
            "@compiled\n"
            "def total(x):\n"
            "    return 1.0 + stretched(x)\n",
        )
        self.write(
            "other_kernels",
            "from systems.compilation import compiled\n"
            "@compiled\n"
            "def half(x):\n"
            "    return 0.5 * x\n",
        )

    def write(self, module, source):
        (self.package / f"{module}.py").write_text(source)

    def start(self, code=USES_CACHE, **variables):
        environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA")}
        return subprocess.Popen(
            [sys.executable, "-c", f"from systems import kernels; {code}"],
            cwd=self.root,
            env=environment | {"PYTHONPATH": str(self.root)} | variables,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(self, code=USES_CACHE, **variables):
        """Import the kernels in a new process, and return its output and its error output."""
        process = self.start(code, **variables)
        out, errors = process.communicate()
        assert process.returncode == 0, errors
        return out.split(), errors

    def cached(self, folder=None):
        folders = (folder or self.package / "__pycache__").rglob("*kernels-*")
        return sorted(path.name.split("-")[0] for path in folders if path.is_dir())


@pytest.fixture
def library(tmp_path):
    return Library(tmp_path / "library")


def test_a_change_in_an_imported_module_is_seen_and_nothing_else_compiles_anew(library):
    code = f"from systems import other_kernels; {USES_CACHE};" + USES_CACHE.replace(
        "kernels.total", "other_kernels.half"
    )
    assert library.run(code) == (["3.0", "0", "0.5", "0"], "")
    assert library.run(code) == (["3.0", "1", "0.5", "1"], "")
    library.write("lengths", "LENGTH = 4.0\n")
    assert library.run(code) == (["5.0", "0", "0.5", "1"], "")
    names = ["systems.inner_kernels", "systems.kernels", "systems.other_kernels"]
    assert library.cached() == names, "older machine code is deleted"


def test_modules_imported_from_their_package_are_followed(library):
    inner = (library.package / "inner_kernels.py").read_text()
    inner = inner.replace("from systems.lengths import LENGTH", "from systems import lengths")
    library.write("inner_kernels", inner.replace("* LENGTH", "* lengths.LENGTH"))
    assert library.run()[0] == ["3.0", "0"]
    library.write("lengths", "LENGTH = 4.0\n")
    assert library.run()[0] == ["5.0", "0"]


def test_the_folder_can_be_chosen_and_shared_by_copies(library, tmp_path):
    other = Library(tmp_path / "other")
    other.write("lengths", "LENGTH = 7.0\n")
    shared = tmp_path / "cache"
    for each, expected in ((library, "3.0"), (other, "8.0")):
        assert each.run(NUMBA_CACHE_DIR=str(shared))[0] == [expected, "0"]
    for each, expected in ((library, "3.0"), (other, "8.0")):
        assert each.run(NUMBA_CACHE_DIR=str(shared))[0] == [expected, "1"]
        assert each.cached() == []
    assert len(library.cached(shared)) == 4


def test_where_the_library_cant_be_written_the_users_cache_folder_is_used(library, tmp_path):
    unwritable(library)
    code = f"{USES_CACHE}; from numba import config; print(repr(config.CACHE_DIR))"
    for hits in ("0", "1"):
        assert library.run(code, XDG_CACHE_HOME=str(tmp_path / "user"))[0] == ["3.0", hits, "''"]
    assert library.cached(tmp_path / "user") == ["systems.inner_kernels", "systems.kernels"]


def unwritable(library):
    """Put files where folders would be made: permissions would not stop a superuser."""
    (library.package / "__pycache__").mkdir()
    (library.package / "__pycache__" / "numba").touch()
    blocked = library.root / "file"
    blocked.touch()
    return {name: str(blocked / "folder") for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}


def test_without_any_writable_folder_it_compiles_and_says_so_once(library):
    variables = unwritable(library)
    for _ in range(2):
        out, errors = library.run(f"from systems import other_kernels; {USES_CACHE}", **variables)
        assert out == ["3.0", "0"]
        assert errors.count("RuntimeWarning: Machine code can't be cached") == 1


def test_without_source_files_it_compiles_and_says_so_once(library):
    compileall.compile_dir(library.package, legacy=True, quiet=2)
    for file in library.package.glob("*.py"):
        file.unlink()
    out, errors = library.run()
    assert out == ["3.0", "0"]
    assert errors.count("RuntimeWarning: Machine code can't be cached") == 1


def test_processes_that_compile_at_once_do_not_disturb_one_another(library):
    library.run()
    library.write("lengths", "LENGTH = 4.0\n")
    processes = [library.start() for _ in range(3)]
    for process in processes:
        out, errors = process.communicate()
        assert (out.split()[0], errors) == ("5.0", "")
    assert library.run()[0] == ["5.0", "1"]


def test_control_c_in_compiled_code_that_returns_arrays_is_a_keyboard_interrupt():
    # Thousands of transitions: nearly all of the time passes in compiled code.
    starts = np.zeros((20, 2))
    ends = np.full((20, 2), 300.0)
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        for delay in (0.002, 0.003, 0.005, 0.007):
            with pytest.raises(KeyboardInterrupt):  # noqa: PT012
                signal.setitimer(signal.ITIMER_REAL, delay)
                while True:
                    split_edges(starts, ends, 0.01)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
