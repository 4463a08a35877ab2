"""One entry for every format: what a file is decides its content, and directories give labels."""

import gzip
import os
import zipfile

import numpy as np
import pytest
from tdms_bytes import write

from specan.errors import InputError, RequestError
from specan.io.open import find_recordings, open_recording

WAVE = {"wf_increment": 0.001}


def signal(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    return write(path, [("c", np.arange(10.0), WAVE)])


def foreign(tmp_path):
    zipped = tmp_path / "zip.tdms"
    with zipfile.ZipFile(zipped, "w") as archive:
        archive.writestr("a.txt", "x")
    files = {
        "pointer": b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 3\n",
        "text": ("x" + "ü" * 400).encode(),  # the first 512 bytes end inside a character
        "empty": b"",
        "zeros": bytes(4096),
        "gzip": gzip.compress(b"x"),
        "index": b"TDSh" + bytes(100),
        "noise": bytes(range(255, 0, -1)),
        "hdf5": b"\x89HDF\r\n\x1a\n" + bytes(50),
    }
    for name, content in files.items():
        (tmp_path / f"{name}.tdms").write_bytes(content)


@pytest.mark.parametrize(
    ("name", "what"),
    [
        ("pointer", "Git-LFS pointer.*git lfs pull"), ("text", "a text file"), ("empty", "is empty"),
        ("zeros", "filled with zeros"),
        ("gzip", "a gzip archive"), ("zip", "a zip archive"), ("index", "index file, which holds no samples"),
        ("noise", "unknown format"), ("hdf5", "a damaged HDF5 file"), ("missing", "does not exist"),
    ],
)  # fmt: skip
def test_what_is_no_recording_is_called_by_its_name(tmp_path, name, what):
    if name == "hdf5":
        pytest.importorskip("h5py")
    foreign(tmp_path)
    with pytest.raises(InputError, match=what) as caught:
        open_recording(tmp_path / f"{name}.tdms")
    assert f"{name}.tdms" in str(caught.value)
    assert caught.value.exit_code == 3


def test_a_directory_is_no_recording(tmp_path):
    with pytest.raises(InputError, match="is a directory"):
        open_recording(tmp_path)


def test_the_content_decides_and_not_the_name(tmp_path):
    signal(tmp_path / "a.tdms").rename(tmp_path / "a.wav")
    assert open_recording(tmp_path / "a.wav").channels[0].name == "c"


def test_labels(tmp_path):
    path = signal(tmp_path / "day 1" / "a.tdms")
    assert open_recording(path).label == "a.tdms"
    assert open_recording(path, root=tmp_path).label == "day 1/a.tdms"
    assert open_recording(path, label="x/a.tdms").label == "x/a.tdms"
    assert open_recording(path, root=tmp_path / "elsewhere").label == "a.tdms"


def test_recordings_of_a_directory(tmp_path):
    for name in ("b/A.TDMS", "a.tdms", "b/c/d.Wav", "b/notes.txt", "a.tdms_index", "B.wav"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "folder.tdms").mkdir()
    found = find_recordings([tmp_path])
    assert [f.label for f in found] == ["B.wav", "a.tdms", "b/A.TDMS", "b/c/d.Wav"]
    assert all(f.path.is_file() for f in found)


@pytest.mark.skipif(os.name == "nt", reason="links need rights there")
def test_a_broken_link_does_not_vanish(tmp_path):
    (tmp_path / "a.tdms").symlink_to(tmp_path / "nowhere.tdms")
    (found,) = find_recordings([tmp_path])
    with pytest.raises(InputError, match="does not exist"):
        open_recording(found.path)


def test_recordings_of_several_directories(tmp_path):
    for name in ("x/day/a.tdms", "y/day/a.tdms", "z/a.tdms"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    found = find_recordings([tmp_path / "x/day", tmp_path / "y/day", tmp_path / "z"])
    assert [f.label for f in found] == ["day-2/a.tdms", "day/a.tdms", "z/a.tdms"]


@pytest.mark.parametrize("name", ["nowhere", "file"])
def test_a_directory_that_is_none(tmp_path, name):
    (tmp_path / "file").touch()
    with pytest.raises(RequestError, match="the directory"):
        find_recordings([tmp_path / name])


def test_samples_of_a_recording_with_fewer_channels(tmp_path):
    """Whoever leaves channels out still gets the samples of those that stay."""
    from dataclasses import replace

    path = write(tmp_path / "a.tdms", [(f"c{k}", np.full(4, k), WAVE) for k in range(3)])
    recording = open_recording(path)
    fewer = replace(recording, channels=recording.channels[1:])
    assert fewer.read(fewer.channels)[:, 0].tolist() == [1.0, 2.0]
