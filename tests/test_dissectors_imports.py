"""What looking at one frame may import: nothing heavy, and nothing of the packages above."""

from __future__ import annotations

import subprocess
import sys

import dissectors


def test_annotating_needs_construct_and_nothing_heavy() -> None:
    code = (
        "import sys\n"
        "from dissectors import Role, annotate, rtu, summary\n"
        "assert annotate(rtu(bytes.fromhex('1103006B00037687')), Role.REQUEST)\n"
        "assert summary(rtu(bytes.fromhex('1103006B00037687')), Role.REQUEST)\n"
        "print(*sorted({name.split('.')[0] for name in sys.modules}))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert {"construct", "dissectors"} <= loaded
    assert not loaded & {"numpy", "orjson", "textual", "mcap", "rich", "analyzer", "captures", "serial"}


def test_importing_the_package_imports_nothing() -> None:
    code = "import sys, dissectors; print(*[n for n in sys.modules if n.startswith(('dissectors.', 'construct'))])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not done.stdout.split()


def test_every_public_name_is_there() -> None:
    assert all(getattr(dissectors, name) is not None for name in dissectors.__all__)
    assert sorted(dissectors.__all__) == sorted(dissectors._MODULES)
