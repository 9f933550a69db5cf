"""Pickles: what is real reads, in every protocol; what is hostile runs nothing and ends soon."""

from __future__ import annotations

import io
import pickle
import resource
import sys
import warnings

import numpy as np
import pytest
from scipy import sparse

from handtrack.errors import InputError
from handtrack.hand.unpickle import plain, unpickle
from tools.fuzz.gadgets import ARGUMENTS, NAMES, bombs, forms, odd, pointers

PATH = "a.pkl"
VALUES = {
    "f8": np.arange(12.0).reshape(3, 4),
    "f4": np.arange(6, dtype=np.float32).reshape(2, 3),
    "f2": np.arange(6, dtype=np.float16),
    "fortran": np.asfortranarray(np.arange(12.0).reshape(3, 4)),
    "turned": np.arange(24.0).reshape(2, 3, 4).transpose(1, 0, 2),
    "big": np.arange(5, dtype=">f8"),
    "big ints": np.arange(5, dtype=">i4"),
    "bool": np.array([True, False, True]),
    "u4": np.array([[2**32 - 1, 0]], np.uint32),
    "i1": np.array([-1, 1], np.int8),
    "0-d": np.array(3.5),
    "none": np.zeros((0, 3)),
    "part": np.arange(20.0)[::3],
    "scalar": np.float64(1.5),
    "scalar f4": np.float32(0.25),
    "scalar int": np.int64(-7),
    "scalar bool": np.bool_(True),
}
PLAIN = {
    "text": "h\xe4nd \U0001f590 \ud800",
    "escapes": "a\\b'c\"d\n\t\x00\xff",
    "bytes": b"\x00\xff'\"\\n",
    "array of bytes": bytearray(b"xyz"),
    "no bytes": b"",
    "numbers": [0, 1, -1, 255, 256, 65536, -(2**31), 2**31, 2**62, -(2**70), 1.5, -0.0, 1e300],
    "other": [None, True, False, (), (1,), (1, 2), (1, 2, 3), (1, 2, 3, 4), [], {}, {1: {2: [3]}}],
}


@pytest.mark.parametrize("protocol", range(6))
def test_real_arrays_and_plain_values(protocol):
    shared = np.arange(4.0)
    content = VALUES | PLAIN | {"a": shared, "b": [shared, shared], "set": {"x", 1}}
    content["long"] = list(range(3000))
    read = unpickle(pickle.dumps(content, protocol), PATH)
    assert list(read) == list(content)
    for name, wanted in VALUES.items():
        assert np.array_equal(read[name], wanted), name
        assert np.asarray(read[name]).dtype == wanted.dtype, name
        assert np.shape(read[name]) == np.shape(wanted), name
    for name, wanted in PLAIN.items():
        assert read[name] == (bytes(wanted) if isinstance(wanted, bytearray) else wanted), name
    assert read["set"] == {"x", 1}
    assert read["b"][0] is read["a"]


@pytest.mark.parametrize("kind", ["csc", "csr", "coo"])
@pytest.mark.parametrize("form", ["matrix", "array"])
@pytest.mark.parametrize("protocol", range(6))
def test_sparse_matrices(kind, form, protocol):
    dense = np.arange(12.0).reshape(3, 4) * (np.arange(12).reshape(3, 4) % 3 == 0)
    given = getattr(sparse, f"{kind}_{form}")(dense)
    read = plain(unpickle(pickle.dumps(given, protocol), PATH))
    assert np.array_equal(read, dense)
    old = {k: v for k, v in vars(given).items() if k not in ("_shape", "coords")}
    old |= {"_shape": (3, 4)} | ({"row": given.row, "col": given.col} if kind == "coo" else {})
    module = f"cscipy.sparse.{kind}\n{kind}_matrix\n)".encode() + b"\x81"
    body = pickle.dumps(old, 2)[:-1]
    assert np.array_equal(plain(unpickle(b"\x80\x02" + module + body[2:] + b"b.", PATH)), dense)


def test_names_of_numpy_1_and_2():
    for protocol in range(6):
        data = pickle.dumps(VALUES, protocol)
        other = data.replace(b"numpy._core.", b"numpy.core.")
        if protocol >= 4:  # the length of the name, and no frames
            other = data.replace(
                b"\x8c\x16numpy._core.multiarray", b"\x8c\x15numpy.core.multiarray"
            )
            other = other.replace(b"\x8c\x13numpy._core.numeric", b"\x8c\x12numpy.core.numeric")
        assert other != data
        for name, wanted in unpickle(other, PATH).items():
            assert np.array_equal(wanted, VALUES[name])


def test_what_is_not_numbers_is_passed_over():
    content = {
        "name": np.str_("cup"), "names": np.array(["a", "bc"]),
        "objects": np.array([1, "a", None], object), "date": np.datetime64("2020"),
        "joints": np.arange(3.0),
    }  # fmt: skip
    read = unpickle(pickle.dumps(content, 4), PATH)
    assert np.array_equal(read["joints"], np.arange(3.0))
    with pytest.raises(TypeError):
        plain(read["names"])


@pytest.fixture
def watched():
    """Events of the interpreter that a reader of arrays has no use for."""
    seen: list[str] = []
    on = [True]

    def hook(event: str, arguments: tuple[object, ...]) -> None:
        if on[0] and event.split(".")[0] in _EVENTS:
            seen.append(f"{event} {arguments}"[:200])

    sys.addaudithook(hook)
    yield seen
    on[0] = False


_EVENTS = {
    "import", "exec", "compile", "open", "os", "subprocess", "socket", "ctypes", "shutil",
    "pickle", "marshal", "tempfile", "code", "pty", "urllib",
}  # fmt: skip


def test_no_gadget_runs_or_imports_anything(watched, tmp_path):
    """Each name in each form; what is refused says what it asked for."""
    assert len(NAMES) >= 200
    count = 0
    cases = [
        (name, data)
        for name in NAMES
        for data in forms(*name.split(), ARGUMENTS[0].replace("TRACE", str(tmp_path / "trace")))
    ]
    cases += list(odd())
    cases += [("a pointer", data) for data in pointers()]
    watched.clear()
    for name, data in cases:
        with pytest.raises(InputError) as refused:
            plain(_first(unpickle(data, PATH), data))
        if " " in name and name != "a pointer":
            assert f"asks for {name.replace(' ', '.')}" in str(refused.value)
        assert len(str(refused.value)) < 400
        count += 1
    assert count > 2500
    assert watched == []
    assert not list(tmp_path.iterdir())


def _first(value: object, data: bytes) -> object:
    """What was not refused is no array of numbers either."""
    try:
        plain(value)
    except TypeError as error:
        raise InputError(str(error), PATH) from None
    raise AssertionError(data[:200])


def test_no_bomb_takes_memory_or_the_process(watched):
    """What ends in an error of ours, and what is read after all, take what the file has."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    cases = list(bombs())
    assert len(cases) > 50
    watched.clear()
    read, texts = set(), []
    for name, data in cases:
        try:
            unpickle(data, PATH)
            read.add(name)
        except InputError as error:
            texts.append(str(error))
    assert read <= {"surrogates", "a frame", "the memo", "a shape of nothing", "stand-ins"}
    assert max(map(len, texts)) < 400
    assert watched == []
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert grown < 700_000  # kB


def test_a_pickle_cut_or_changed_anywhere_is_read_or_refused():
    data = pickle.dumps({"a": [VALUES, PLAIN], "b": sparse.csc_matrix(np.eye(3))}, 2)
    rng = np.random.default_rng(5)
    refused = 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(3000):
            bad = bytearray(data[: int(rng.integers(len(data)))] if rng.random() < 0.2 else data)
            for place in rng.integers(len(bad) or 1, size=3 if bad else 0):
                bad[place] = int(rng.integers(256))
            try:
                unpickle(bytes(bad), PATH)
            except InputError:
                refused += 1
    assert refused > 1000


def test_python_reads_the_same(tmp_path):
    """Where nothing is hostile, the machine and Python's own agree."""
    content = VALUES | PLAIN
    for protocol in range(6):
        data = pickle.dumps(content, protocol)
        ours, theirs = unpickle(data, PATH), pickle.load(io.BytesIO(data))
        for name, value in theirs.items():
            assert np.array_equal(ours[name], value) or ours[name] == value, name
