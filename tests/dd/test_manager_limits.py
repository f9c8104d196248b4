"""Limits and interrupts end an operation cleanly; handles may die in any order; importing is cheap."""

from __future__ import annotations

import gc
import itertools
import random
import signal
import subprocess
import sys
import textwrap
import time

import numpy as np
import pytest

from symcheck.dd.manager import DiagramManager
from symcheck.errors import Interrupted, MemoryLimitError, TimeLimitError

NAMES = [f"x{i}" for i in range(40)]


def operands(manager):
    """Two diagrams whose product would have 2**26 leaves."""
    numbers = np.random.default_rng(0)
    manager.add_variables(NAMES)
    return manager.table(NAMES[0:26:2], numbers.random(2**13)), manager.table(
        NAMES[26:39], numbers.random(2**13)
    )


def test_time_limit():
    manager = DiagramManager()
    left, right = operands(manager)
    manager.limit_time(0.1)
    start = time.monotonic()
    with pytest.raises(TimeLimitError, match="time limit was reached"):
        left * right
    assert time.monotonic() - start < 10
    with pytest.raises(TimeLimitError):
        left * right
    manager.limit_time(None)
    manager.core.check()
    assert (left + 1).leaves.size == left.leaves.size


def test_time_limit_of_many_small_operations():
    manager = DiagramManager(time_limit=0.05)
    (x,) = manager.add_variables(["x"])
    with pytest.raises(TimeLimitError):
        _ = [x & x for _ in itertools.count()]


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="needs interval timers")
@pytest.mark.parametrize("own", [True, False])
def test_interrupt(own):
    """In a recursion of ours and in one of CUDD's."""
    manager = DiagramManager()
    left, right = operands(manager)
    sets = [
        manager.bdd_table(NAMES[:18], np.random.default_rng(i).random(2**18) < 0.5)
        for i in range(2)
    ]
    far = sets[1].rename(manager.renaming(dict(zip(NAMES[:18], NAMES[18:36], strict=True))))
    manager.reorder(
        [
            *(name for pair in zip(NAMES[:18], NAMES[18:36], strict=True) for name in pair),
            *NAMES[36:],
        ]
    )
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        with pytest.raises(Interrupted) as caught:
            _ = left * right if own else sets[0] & far
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert isinstance(caught.value.__cause__, KeyboardInterrupt)
    manager.core.check()
    assert sets[0] & ~sets[0] == manager.false


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="needs interval timers")
def test_what_a_signal_handler_raises_comes_through():
    manager = DiagramManager()
    left, right = operands(manager)

    def handler(number, frame):
        raise LookupError("mine")

    before = signal.signal(signal.SIGALRM, handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        with pytest.raises(LookupError, match="mine"):
            _ = left * right
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    manager.core.check()


def test_a_higher_memory_limit_helps():
    manager = DiagramManager(max_memory=4 * 2**20)
    manager.add_variables(NAMES)
    values = np.random.default_rng(0).random(2**17)
    with pytest.raises(MemoryLimitError, match="-cuddmaxmem"):
        manager.table(NAMES[:17], values)
    manager.limit_memory(100 * 2**20)
    assert manager.table(NAMES[:17], values).leaves.size == 2**17


def test_a_hundred_managers_at_once():
    managers = [DiagramManager() for _ in range(100)]
    handles = [(manager, *manager.add_variables("xy")) for manager in managers]
    handles = [(x & y, (x | y).to_mtbdd(0.5)) for _, x, y in handles]
    del managers
    random.Random(0).shuffle(handles)
    assert all(m.to_bdd() >= f for f, m in handles)
    assert sum(m.core.statistics()["memory"] for _, m in handles) < 1000 * 2**20


def test_handles_outlive_their_manager():
    manager = DiagramManager()
    x, y = manager.add_variables("xy")
    m = manager.table("xy", [1, 2, 3, 4])
    f, cube = (x & y).to_dd(), manager.cube("x")
    del manager, x
    gc.collect()
    assert m.sum_over(cube).leaves.tolist() == [4, 6]
    del m, cube, y
    gc.collect()
    assert len(f) == 3


def run(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


@pytest.mark.parametrize(
    "ending",
    [
        "",
        "del manager, all",
        "del x, f, all; del manager; gc.collect()",
        "class Holder: pass\nh = Holder(); h.me = h; h.all = all; del all, h, f, manager, m, cube, renaming, x; gc.collect()",
        "manager.me = manager; manager.handles = [f, m, x, cube]; del all, manager, f, m, x, cube, renaming; gc.collect()",
        "import sys; sys.modules['keep'] = [f, m]; del all, manager",
        "del f, m, manager, x, cube, renaming\nimport random\nwhile all: all.pop(random.randrange(len(all)))",
        "raise SystemExit(0)",
    ],
)
def test_teardown_in_any_order(ending):
    """dd reports nodes that are still referenced on stderr, and a double release would crash."""
    code = """
    import gc
    from symcheck.dd.manager import DiagramManager
    manager = DiagramManager()
    x, y = manager.add_variables("xy")
    f = x & ~y
    m = manager.table("xy", [0.5, 1, 2, 3])
    cube, renaming = manager.cube("x"), manager.renaming({"x": "y", "y": "x"})
    all = [f, manager, m, cube, renaming, x]
    """
    done = run(textwrap.dedent(code) + ending)
    assert (done.returncode, done.stderr) == (0, "")


def test_importing_leaves_networkx_alone():
    done = run("""
        import sys
        from symcheck.dd.manager import DiagramManager
        assert "networkx" not in sys.modules
        try:
            import networkx
        except ImportError:
            raise SystemExit("missing")
        from dd import _utils
        assert _utils.import_module("networkx").MultiDiGraph is networkx.MultiDiGraph
        """)
    if done.stderr.strip() == "missing":
        pytest.skip("networkx is not installed")
    assert (done.returncode, done.stderr) == (0, "")


def test_networkx_that_is_loaded_already_is_kept():
    done = run("""
        import sys, types
        sys.modules["networkx"] = mine = types.ModuleType("networkx")
        mine.MultiDiGraph = object
        import symcheck.dd.manager
        from dd import _utils
        assert sys.modules["networkx"] is mine and _utils.import_module("networkx") is mine
        """)
    assert (done.returncode, done.stderr) == (0, "")


def test_importing_keeps_nothing_of_its_caller_alive():
    """dd keeps the error of the import that is made to fail; its traceback would keep the frames of all that were active."""
    done = run("""
        import weakref
        class Large: pass
        def work():
            large = Large()
            seen = weakref.ref(large)
            import symcheck.dd.manager
            return seen
        assert work()() is None
        """)
    assert (done.returncode, done.stderr) == (0, "")
