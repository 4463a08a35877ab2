"""Time series that other programs write - text, MAT, HDF5, universal files - are recordings like TDMS and WAV."""

import sys
import types

import numpy as np
import pytest
from click.testing import CliRunner

from specan.errors import InputError
from specan.io import mat
from specan.io import open as opening
from specan.io.export_file import write_result
from specan.io.open import open_recording
from specan_cli.main import main

RATE, N = 2000.0, 6000
TIME = np.arange(N) / RATE
FORCE = 3.0 * np.sin(2 * np.pi * 100 * TIME)  # N
MOVED = 2e-3 * np.cos(2 * np.pi * 100 * TIME)  # m, in mm in the files


def check(recording, exact=True):
    force, moved = recording.channel("force"), recording.channel("x1")
    assert (force.unit, moved.unit, force.role) == ("N", "m", "force")
    assert force.sampling_rate == moved.sampling_rate == RATE
    found = recording.read([force, moved], 10, 4000)
    tolerance = 1e-12 if exact else 1e-4
    np.testing.assert_allclose(found[0], FORCE[10:4000], atol=3 * tolerance)
    np.testing.assert_allclose(found[1], MOVED[10:4000], atol=2e-3 * tolerance)


TEXTS = {
    "commas": ("time [s],force [N],x1 [mm]\n", ",", "."),
    "decimal commas": ("t (s);force (N);x1 (mm)\n", ";", ","),
    "units below": ("Zeit\tforce\tx1\n[ms]\t[N]\t[mm]\n", "\t", "."),
    "a comment first": ("# made by a logger\ntime_s;force [N];x1 [mm]\n", ";", "."),
    "lines above the header": (
        "Messung vom 12.11.2026;;\nPrüfer: Müller;;\n\nZeit [s];force [N];x1 [mm]\n",
        ";",
        ",",
    ),
}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize("form", TEXTS)
def test_text(tmp_path, form, encoding):
    header, sign, decimal = TEXTS[form]
    scale = 1000 if "ms" in header else 1
    rows = "".join(
        sign.join(f"{v:.15g}" for v in row) + "\n"
        for row in zip(scale * TIME, FORCE, 1e3 * MOVED, strict=True)
    )
    path = tmp_path / "run.csv"
    path.write_text(header + rows.replace(".", decimal), encoding=encoding)
    check(open_recording(path))


def test_names_and_units_of_a_spreadsheet_of_western_windows(tmp_path):
    path = tmp_path / "run.csv"
    rows = "".join(f"{k / 100:.2f};{k % 7};{k % 5}\r\n".replace(".", ",") for k in range(200))
    path.write_bytes(("Zeit [s];Tür [Pa];Gehäuse [mm/s²]\r\n" + rows).encode("cp1252"))
    found = open_recording(path)
    assert [(c.name, c.unit) for c in found.channels] == [("Tür", "Pa"), ("Gehäuse", "m/s^2")]
    assert found.read("Gehäuse")[0].max() == pytest.approx(4e-3)


def test_what_export_writes_comes_back(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "run.csv"
    header, sign, _ = TEXTS["commas"]
    rows = "".join(
        sign.join(f"{v:.15g}" for v in row) + "\n" for row in zip(TIME, FORCE, 1e3 * MOVED, strict=True)
    )
    path.write_text(header + rows, encoding="utf-8")
    run = CliRunner().invoke
    for form, exact in (("csv", False), ("uff", True)):
        done = run(main, ["export", "run.csv", "-o", f"again.{form}"], catch_exceptions=False)
        assert done.exit_code == 0, done.output
        check(open_recording(tmp_path / f"again.{form}"), exact)
    octave = run(main, ["octave", "again.uff", "--json"], catch_exceptions=False)
    assert octave.exit_code == 0


def test_a_universal_file_may_begin_with_an_empty_line(tmp_path, monkeypatch):
    pytest.importorskip("pyuff")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run.csv").write_text(
        "t,force [N]\n" + "".join(f"{k / 1000},{(k * k) % 7}\n" for k in range(64)), encoding="utf-8"
    )
    assert CliRunner().invoke(main, ["export", "run.csv", "-o", "run.uff"]).exit_code == 0
    (tmp_path / "other.uff").write_bytes(b"\n" + (tmp_path / "run.uff").read_bytes())
    found = open_recording(tmp_path / "other.uff")
    np.testing.assert_allclose(found.read(found.channels)[0], [(k * k) % 7 for k in range(64)], atol=1e-12)


def test_times_that_are_not_equally_spaced(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("t,a\n" + "".join(f"{t},1\n" for t in (0, 1, 2, 3, 5, 8, 13)), encoding="utf-8")
    with pytest.raises(InputError, match=r"not uniform.*--sampling-rate"):
        open_recording(path)


def test_a_cell_that_is_no_number(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("t,a\n" + "".join(f"{t},1\n" for t in range(9)) + "9,overload\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"run\.csv holds a cell that is not a number .*overload"):
        open_recording(path)


MATS = {
    "variables": {"fs": RATE, "force": FORCE, "x1": 1e3 * MOVED, "force_unit": "N", "x1_unit": "mm"},
    "a matrix with names": {
        "dt": 1 / RATE, "data": np.stack([FORCE, 1e3 * MOVED], axis=1), "names": ["force", "x1"], "units": ["N", "mm"],
    },
    "a matrix of rows and a time": {
        "t": TIME, "y": np.stack([FORCE, 1e3 * MOVED]), "labels": ["force", "x1"], "units": ["N", "mm"],
    },
    "structures": {
        f"Signal_{k}": {
            "x_values": {"start_value": 0.0, "increment": 1 / RATE, "number_of_values": N},
            "y_values": {"values": values, "unit": unit},
            "name": name,
        }
        for k, (name, values, unit) in enumerate((("force", FORCE, "N"), ("x1", 1e3 * MOVED, "mm")))
    },
}  # fmt: skip


@pytest.mark.parametrize("form", [f for f in MATS if f != "structures"])
def test_mat(tmp_path, form):
    from scipy.io import savemat

    content = dict(MATS[form])
    for key in ("names", "labels", "units"):
        if key in content:
            content[key] = np.array(content[key], dtype=object)
    path = tmp_path / "run.bin"  # the content decides
    savemat(path.with_suffix(".mat"), content)
    path.with_suffix(".mat").rename(path)
    check(open_recording(path))


def test_mat_of_nested_structures(tmp_path):
    from scipy.io import savemat

    savemat(tmp_path / "run.mat", MATS["structures"])
    found = open_recording(tmp_path / "run.mat")
    assert [c.sampling_rate for c in found.channels] == [RATE, RATE]
    assert [c.unit for c in found.channels] == ["N", "m"]
    np.testing.assert_allclose(found.read(found.channels, 0, N)[0], FORCE)


def test_hdf5_with_attributes(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "run.h5", "w") as file:
        group = file.create_group("measurement")
        group.attrs["sampling_rate"] = RATE
        for name, values, unit in (("force", FORCE, "N"), ("x1", 1e3 * MOVED, "mm")):
            group[name] = values
            group[name].attrs["unit"] = unit
        file["settings"] = np.arange(5.0)
    found = open_recording(tmp_path / "run.h5")
    check(found)
    assert found.channel("force").group == "measurement"


def test_one_unit_of_an_array_of_several_channels_is_that_of_each(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["pressure"] = np.column_stack([FORCE, MOVED])
        file["pressure"].attrs.update({"unit": "mPa", "sampling_rate": RATE})
    found = open_recording(tmp_path / "run.h5")
    assert [(c.name, c.unit, c.gain) for c in found] == [
        ("pressure 1", "Pa", 1e-3),
        ("pressure 2", "Pa", 1e-3),
    ]


def test_hdf5_without_a_rate_asks_for_one(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["force"] = FORCE
        file["mode_shapes"] = np.ones((30, 30))
    found = open_recording(tmp_path / "run.h5")
    assert found.channel("force").sampling_rate == 0
    assert "not a set of signals" in found.set_aside["mode_shapes"]
    assert open_recording(tmp_path / "run.h5", sampling_rate=RATE).channel("force").sampling_rate == RATE


def test_matlab_7_3(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "run.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["fs"] = np.array([[RATE]])
        file["force"] = FORCE[None]
        file["x1"] = 1e3 * MOVED[None]
        for name, unit in (("force", "N"), ("x1", "mm")):
            file[f"{name}_unit"] = np.array([[ord(c)] for c in unit], dtype=np.uint16)
            file[f"{name}_unit"].attrs["MATLAB_class"] = np.bytes_("char")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(126) + b"\0\2IM")
    check(open_recording(path))


def test_a_missing_h5py_names_the_extra(tmp_path, monkeypatch):
    (tmp_path / "run.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(Exception, match=r"specan\[hdf5\]"):
        open_recording(tmp_path / "run.h5")


def test_uff_of_another_writer_in_ascii(tmp_path):
    pyuff = pytest.importorskip("pyuff")
    file = pyuff.UFF(str(tmp_path / "run.uff"))
    for node, (name, values, unit) in enumerate((("force", FORCE, "N"), ("x1", 1e3 * MOVED, "mm")), 1):
        content = pyuff.prepare_58(
            binary=0, func_type=1, id1=name, rsp_node=node, rsp_dir=3, ref_node=0, ref_dir=0, data=values, x=TIME,
            ord_data_type=4, abscissa_spacing=1, num_pts=N, abscissa_min=0.0, abscissa_inc=1 / RATE,
            ordinate_axis_units_lab=unit, ordinate_spec_data_type=0, abscissa_spec_data_type=17,
            orddenom_spec_data_type=0, z_axis_spec_data_type=0,
        )  # fmt: skip
        file.write_sets(content, "add")
    check(open_recording(tmp_path / "run.uff"), exact=False)


def test_hdf5_that_leads_to_another_file_is_not_followed(tmp_path):
    h5py = pytest.importorskip("h5py")
    secret = np.arange(100.0)
    (tmp_path / "secret.bin").write_bytes(secret.tobytes())
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["Mic"] = secret
    layout = h5py.VirtualLayout((100,), "f8")
    layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "Mic", (100,))
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file.attrs["fs"] = 1000.0
        file["Good"] = np.sin(secret)
        file.create_dataset("Stored", (100,), "f8", external=[(str(tmp_path / "secret.bin"), 0, 800)])
        file.create_virtual_dataset("Virtual", layout)
        file["Linked"] = h5py.ExternalLink("other.h5", "/Mic")
    found = open_recording(tmp_path / "run.h5")
    assert [c.name for c in found.channels] == ["Good"]
    assert set(found.set_aside) == {"Stored", "Virtual", "Linked"}
    assert all("another file" in why for why in found.set_aside.values())


def test_mat_that_crashes_its_reader_or_takes_all_memory_ends_in_a_message(tmp_path, monkeypatch):
    from scipy.io import savemat

    savemat(tmp_path / "bomb.mat", {"Mic": np.zeros(40_000_000), "fs": 1000.0}, do_compression=True)
    assert (tmp_path / "bomb.mat").stat().st_size < 1e6
    monkeypatch.setattr(mat, "_BYTES", 600_000_000)
    if sys.platform != "win32":
        with pytest.raises(InputError, match=r"takes more than 0\.6 GB of memory"):
            open_recording(tmp_path / "bomb.mat")
    savemat(tmp_path / "crash.mat", {"Mic": np.zeros(100)})
    monkeypatch.setattr(sys, "executable", str(tmp_path / "crash.py"))
    (tmp_path / "crash.py").write_text("#!/bin/sh\nkill -SEGV $$\n")
    (tmp_path / "crash.py").chmod(0o700)
    if sys.platform != "win32":
        with pytest.raises(InputError, match="its reader crashed"):
            open_recording(tmp_path / "crash.mat")


def test_a_format_of_an_installed_package(tmp_path, monkeypatch):
    """As an entry point of the group specan.formats brings it."""
    from specan.data.recording import ArraySource
    from specan.io.sampling_rate import Rate
    from specan.io.signals import Signal

    module = types.SimpleNamespace(
        SUFFIXES=(".dat",),
        recognises=lambda start: start.startswith(b"ACME"),
        open_recording=lambda path, said: said.recording(
            [Signal("force", N, "N", Rate(RATE, "its header")), Signal("x1", N, "mm", Rate(RATE, "its header"))],
            ArraySource([FORCE, 1e3 * MOVED]),
        ),
    )  # fmt: skip
    point = types.SimpleNamespace(name="acme", load=lambda: module)
    monkeypatch.setattr(opening, "entry_points", lambda group: [point] if group == "specan.formats" else [])
    (tmp_path / "run.dat").write_bytes(b"ACME" + bytes(10))
    check(open_recording(tmp_path / "run.dat"))
    assert [found.label for found in opening.find_recordings([tmp_path])] == ["run.dat"]
    (tmp_path / "other.dat").write_bytes(b"EMCA" + bytes(10))
    with pytest.raises(InputError, match="of an unknown format"):
        open_recording(tmp_path / "other.dat")


def test_a_unit_in_the_letters_of_western_windows(tmp_path):
    """In Windows-1252 the byte of ² is B2; read without it, the acceleration would be a velocity."""
    pyuff = pytest.importorskip("pyuff")
    path = tmp_path / "run.uff"
    content = pyuff.prepare_58(
        binary=0, func_type=1, id1="run", rsp_node=1, rsp_dir=3, ref_node=0, ref_dir=0, data=1e3 * MOVED, x=TIME,
        ord_data_type=4, abscissa_spacing=1, num_pts=N, abscissa_min=0.0, abscissa_inc=1 / RATE,
        ordinate_axis_units_lab="mm/s^2", ordinate_spec_data_type=12, abscissa_spec_data_type=17,
        orddenom_spec_data_type=0, z_axis_spec_data_type=0,
    )  # fmt: skip
    pyuff.UFF(str(path)).write_sets(content, "add")
    raw = path.read_bytes()
    assert b"mm/s^2" in raw
    path.write_bytes(raw.replace(b"mm/s^2", b"mm/s\xb2 "))
    channel = open_recording(path).channels[0]
    assert channel.unit == "m/s^2"
    assert channel.gain == pytest.approx(1e-3)


@pytest.mark.parametrize("ending", ["mat", "h5", "uff"])
def test_damaged_files_are_said_to_be(tmp_path, ending):
    if ending == "h5":
        pytest.importorskip("h5py")
    starts = {
        "mat": b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM" + b"\xff" * 200,
        "h5": b"\x89HDF\r\n\x1a\n" + b"\xff" * 200,
        "uff": b"    -1\n    58\nabc\n",
    }
    path = tmp_path / f"run.{ending}"
    path.write_bytes(starts[ending])
    with pytest.raises(InputError, match=rf"run\.{ending}"):
        open_recording(path)


def test_densities_and_transfer_functions_come_back_from_a_universal_file(tmp_path, monkeypatch):
    pytest.importorskip("pyuff")
    import specan

    monkeypatch.chdir(tmp_path)
    rate, noise = 4096, np.random.default_rng(3).standard_normal(40960)
    source = specan.Recording.from_arrays(
        {"Force": noise, "Acc 1": 2 * noise}, rate, units={"Force": "N", "Acc 1": "m/s^2"}
    )
    found = specan.fft(source, scaling="psd", lines=400)
    write_result(found, tmp_path / "density.uff")
    table = specan.read_functions("density.uff")
    force = table[table.response == "Force"]
    assert set(table.function) == {"power spectral density"}
    assert force.value.to_numpy() == pytest.approx(found.density[0])
    assert set(force.unit) == {"N^2/Hz"}
    assert force.frequency_hz.to_numpy() == pytest.approx(found.frequency_hz)
    write_result(specan.frf(source, "Force", channels="Acc 1", lines=400), tmp_path / "frf.uff")
    table = specan.read_functions("frf.uff")
    ratio = table[table.function == "transfer function"]
    assert set(table.function) == {"transfer function", "coherence"}
    assert ratio.value.to_numpy() == pytest.approx(2.0, abs=1e-9)  # what was made
    assert set(ratio.reference) == {"Force"}
    result = CliRunner().invoke(main, ["info", "density.uff"])
    assert result.exit_code != 0
    assert "power spectral density (2)" in str(result.exception)
