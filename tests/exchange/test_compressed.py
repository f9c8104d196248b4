"""Files whose names end in .gz and .xz are compressed, wherever they are read or written."""

from __future__ import annotations

import gzip
import lzma
from pathlib import Path

import pytest

import symcheck
from symcheck.cli import main
from symcheck.errors import UsageError

DIE = Path(__file__).parents[2] / "models/die"
PACK = {".gz": gzip.compress, ".xz": lzma.compress}


@pytest.fixture
def die():
    return symcheck.load(DIE / "die.pm")


@pytest.mark.parametrize("packed", PACK)
@pytest.mark.parametrize("files", ["die.all", "die.tra,lab,srew", "die.drn"])
def test_explicit_files_are_written_and_read(die, files, packed, tmp_path):
    written = symcheck.export(die, f"{tmp_path}/{files}{packed}")
    plain = symcheck.export(die, f"{tmp_path}/{files}")
    unpack = {".gz": gzip.decompress, ".xz": lzma.decompress}[packed]
    assert all(w == p + packed for w, p in zip(written, plain, strict=True))
    for w, p in zip(written, plain, strict=True):
        assert unpack(Path(w).read_bytes()) == Path(p).read_bytes()
    again = symcheck.load_explicit(f"{tmp_path}/{files}{packed}")
    assert again.check('R=? [ F "done" ]').value == pytest.approx(11 / 3)


@pytest.mark.parametrize("packed", PACK)
@pytest.mark.parametrize("name", ["die.pm", "die.jani"])
def test_models_and_properties_are_read(name, packed, tmp_path, capsys):
    for file in (name, "die.pctl"):
        (tmp_path / (file + packed)).write_bytes(PACK[packed]((DIE / file).read_bytes()))
    model = symcheck.load(tmp_path / (name + packed))
    assert model.engine.states == 13
    properties = [str(tmp_path / ("die.pctl" + packed))] if name == "die.pm" else []
    assert main([str(tmp_path / (name + packed)), *properties]) == 0
    assert "Result: 0.1666" in capsys.readouterr().out


def test_single_switches_write_compressed_files(tmp_path, capsys):
    names = {
        s: str(tmp_path / f"{s}.gz")
        for s in ("exporttrans", "exportjani", "exportprism", "exportvector", "exportsteadystate")
    }
    switches = [word for s, path in names.items() for word in (f"-{s}", path)]
    assert main([str(DIE / "die.pm"), "-pf", "P=? [ F d=6 ]", "-steadystate", *switches]) == 0
    for path in names.values():
        assert gzip.decompress(Path(path).read_bytes())
    assert main(["-importtrans", names["exporttrans"]]) == 0
    assert "States:      13" in capsys.readouterr().out


def test_the_same_text_gives_the_same_file(die, tmp_path):
    first = Path(symcheck.export(die, f"{tmp_path}/a.drn.gz")[0]).read_bytes()
    second = Path(symcheck.export(die, f"{tmp_path}/b.drn.gz")[0]).read_bytes()
    assert first == second


@pytest.mark.parametrize("packed", PACK)
def test_a_damaged_file_is_an_error(packed, tmp_path):
    whole = PACK[packed]((DIE / "die.pm").read_bytes())
    for data in (b"dtmc", whole[: len(whole) // 2]):
        (tmp_path / f"die.pm{packed}").write_bytes(data)
        with pytest.raises(UsageError, match=f"not a whole {packed} file"):
            symcheck.load(tmp_path / f"die.pm{packed}")


def test_a_umb_file_is_not_compressed_twice(die, tmp_path):
    pytest.importorskip("umbi")
    with pytest.raises(UsageError, match="compressed already"):
        symcheck.export(die, f"{tmp_path}/die.umb.gz")
    assert not list(tmp_path.iterdir())
