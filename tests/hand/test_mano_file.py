"""MANO files as they are found: pickles of several ages, conversions, and things that are not."""

from __future__ import annotations

import io
import pickle
import pickletools
from pathlib import Path

import numpy as np
import pytest

from handtrack.errors import InputError, SettingsError
from handtrack.hand.mano import MANO
from handtrack.hand.mano_file import find_mano, read_mano


def same(read, content):
    for key, value in read.items():
        if hasattr(content[key], "toarray"):
            content = content | {key: content[key].toarray()}
        assert np.abs(value - np.asarray(content[key], np.float64)).max() < 1e-12, key


@pytest.fixture
def write(tmp_path):
    def to_file(content, name="MANO_RIGHT.pkl", **options) -> Path:
        path = tmp_path / name
        path.write_bytes(
            content if isinstance(content, bytes) else pickle.dumps(content, **options)
        )
        return path

    return to_file


def test_the_stand_in_is_stored_like_mano(mano_folder):
    """Python 2's strings, chumpy's nodes, scipy's old module: or the tests below prove nothing."""
    data = (mano_folder / "MANO_RIGHT.pkl").read_bytes()
    asked = {argument for code, argument, _ in pickletools.genops(data) if code.name == "GLOBAL"}
    assert asked >= {
        "chumpy.ch Ch",
        "chumpy.reordering Select",
        "scipy.sparse.csc csc_matrix",
        "numpy.core.multiarray _reconstruct",
    }
    codes = {code.name for code, _, _ in pickletools.genops(data)}
    assert {"BINSTRING", "SHORT_BINSTRING"} <= codes
    assert not codes & {"BINUNICODE", "BINBYTES"}
    with pytest.raises(ModuleNotFoundError, match="chumpy"):
        pickle.loads(data, encoding="latin1")


@pytest.mark.parametrize("protocol", [0, 1, 2])
@pytest.mark.parametrize("hand", ["right", "left"])
def test_pickles_of_python_2(maker, contents, tmp_path, hand, protocol):
    path = tmp_path / f"MANO_{hand.upper()}.pkl"
    with path.open("wb") as file:
        maker.write_pickle(contents[hand], file, protocol)
    same(read_mano(path), contents[hand])


@pytest.mark.filterwarnings("ignore:the matrix subclass")
@pytest.mark.parametrize("protocol", [2, 3, 4, 5])
@pytest.mark.parametrize("sparse", [None, "csc_matrix", "csr_matrix", "coo_matrix", "csc_array"])
def test_pickles_without_chumpy(contents, write, protocol, sparse):
    import scipy.sparse

    content = dict(contents["right"])
    if sparse:
        content["J_regressor"] = getattr(scipy.sparse, sparse)(content["J_regressor"])
    else:
        content["J_regressor"] = np.matrix(content["J_regressor"])
    content["kintree_table"] = content["kintree_table"].astype(np.int64)
    content["v_template"] = np.asfortranarray(content["v_template"].astype(np.float32))
    same(read_mano(write(content, protocol=protocol)), content)


def test_npz_conversions(maker, contents, tmp_path, mano_folder):
    plain, objects = tmp_path / "plain_right.npz", tmp_path / "objects_right.npz"
    np.savez_compressed(plain, **contents["right"])
    same(read_mano(plain), contents["right"])
    from scipy.sparse import csc_matrix

    content = contents["right"] | {"J_regressor": csc_matrix(contents["right"]["J_regressor"])}
    np.savez(objects, **content)  # a pickle inside, which NumPy will not read unasked
    with pytest.raises(ValueError, match="allow_pickle"):
        np.load(objects)["J_regressor"]
    same(read_mano(objects), contents["right"])
    assert np.array_equal(MANO.load(plain).template, MANO.load(mano_folder, "right").template)


def test_files_are_found_where_people_keep_them(mano_folder, tmp_path):
    for folder in ("mano", "models"):
        (tmp_path / folder).mkdir()
        there = tmp_path / folder / "MANO_LEFT.pkl"
        there.write_bytes(b"")
        assert find_mano(tmp_path, "left") == there
        there.unlink()
    with pytest.raises(InputError, match=r"MANO_LEFT\.pkl"):
        find_mano(tmp_path, "left")
    with pytest.raises(InputError, match="no such file"):
        find_mano(tmp_path / "nowhere", "left")


class Runs:
    """Something that runs when it is unpickled."""

    def __init__(self, path):
        self.path = str(path)

    def __reduce__(self):
        return open, (self.path, "w")


@pytest.mark.parametrize("protocol", [0, 2, 5])
def test_code_is_refused_by_name_and_not_run(write, tmp_path, protocol, contents):
    trace = tmp_path / "trace"
    content = contents["right"] | {"hands_mean": Runs(trace)}
    with pytest.raises(InputError, match=r"MANO_RIGHT\.pkl: asks for (_io|io)\.open"):
        read_mano(write(content, protocol=protocol))
    assert not trace.exists()


@pytest.mark.parametrize(
    "asks",
    ["os system", "builtins eval", "__builtin__ getattr", "numpy load", "posix system",
     "chumpy.ch ChLambda", "functools partial", "numpy.core.multiarray fromfile"],
)  # fmt: skip
def test_whatever_else_it_asks_for_is_named(write, asks):
    module, name = asks.split()
    body = f"c{module}\n{name}\n(S'echo'\ntR.".encode()
    with pytest.raises(InputError, match=f"asks for {module}.{name}"):
        read_mano(write(body))


def test_known_names_do_nothing_else_than_store(write):
    """The ways round: other codecs, foreign classes for _reconstructor, attributes of classes."""
    for body in (
        b"c_codecs\nencode\n(S'x'\nS'bz2'\ntR.",
        b"ccopy_reg\n_reconstructor\n(c__builtin__\nset\nc__builtin__\nobject\nNtR.",
        b"cchumpy.ch\nCh\n(tR(lp0\nb.",
        b"\x80\x04\x8c\x05numpy\x8c\x10ndarray.__init__\x93.",
        b"\x80\x02\x82\x01.",  # an extension code
        b"Pname\n.",  # a persistent id
        b"Nr\xff\xff\xff\x7f.",  # a place in the memo that takes 32 GB
    ):
        with pytest.raises(InputError, match="MANO_RIGHT"):
            read_mano(write(body))


def test_a_torn_file_is_an_input_error(mano_folder, write):
    data = (mano_folder / "MANO_RIGHT.pkl").read_bytes()
    for end in (0, 1, 2, 100, len(data) // 2, len(data) - 1):
        with pytest.raises(InputError, match="no pickle, or a damaged one"):
            read_mano(write(data[:end]))
    archive = io.BytesIO()
    np.savez(archive, a=np.zeros(3))
    with pytest.raises(InputError, match=r"\.npz file is damaged"):
        read_mano(write(archive.getvalue()[:50]))


def test_flipped_bytes_are_read_or_refused(mano_folder, write):
    """No other exception comes out, whatever byte is wrong."""
    data = (mano_folder / "MANO_RIGHT.pkl").read_bytes()
    codes = [place for _, _, place in pickletools.genops(data)]
    rng = np.random.default_rng(3)
    refused = 0
    for place in rng.choice(codes, 150, replace=False):
        bad = bytearray(data)
        bad[place] ^= 1 << rng.integers(8)
        try:
            read_mano(write(bytes(bad)))
        except InputError:
            refused += 1
    assert refused > 75


def test_a_few_bytes_take_no_memory(write, contents):
    """Arrays that a pickle asks for without storing them, and sparse lines without entries."""
    huge = b"cnumpy\nndarray\n((I20000\nI20000\ntcnumpy\ndtype\n(S'f8'\ntRtR."
    keys = [k for k in contents["right"] if k != "v_template"]
    rest = pickle.dumps({k: contents["right"][k] for k in keys}, protocol=0)[:-1]
    # the dictionary, its missing key, the huge array, SETITEM, STOP
    with pytest.raises(InputError, match="v_template does not hold an array of numbers"):
        read_mano(write(rest + b"S'v_template'\n" + huge[:-1] + b"s."))
    from scipy.sparse import csc_matrix

    matrix = csc_matrix(contents["right"]["J_regressor"])
    matrix.indptr = matrix.indptr.astype(np.int64)
    matrix.indptr[-1] = 10**12
    with pytest.raises(InputError, match="J_regressor does not hold an array of numbers: a sparse"):
        read_mano(write(contents["right"] | {"J_regressor": matrix}))


def without(key):
    return lambda c: {k: v for k, v in c.items() if k != key}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (without("posedirs"), "lacks posedirs"),
        (lambda c: {"a": 1}, "lacks v_template"),
        (lambda c: [1, 2], "holds a list"),
        (lambda c: c | {"weights": c["weights"][:, :15]}, r"weights has shape \(778, 15\)"),
        (lambda c: c | {"v_template": c["v_template"][:700]}, "expected 778 x 3"),
        (lambda c: c | {"shapedirs": np.zeros((778, 3))}, "expected 778 x 3 x any"),
        (lambda c: c | {"shapedirs": np.zeros((778, 3, 0))}, "shapedirs has shape"),
        (lambda c: c | {"posedirs": c["posedirs"] * np.nan}, "posedirs holds values"),
        (lambda c: c | {"hands_mean": "mean"}, "hands_mean does not hold an array of numbers"),
        (lambda c: c | {"f": c["f"] + 1}, "f names vertices"),
        (lambda c: c | {"kintree_table": c["kintree_table"][:, ::-1]}, "kintree_table"),
        (lambda c: c | {"weights": c["weights"] * 2}, "rows of weights"),
        (lambda c: c | {"v_template": c["v_template"] * 1000}, "a hand in metres"),
    ],
)
def test_what_is_wrong_is_named(write, contents, change, says):
    with pytest.raises(InputError, match=rf"MANO_RIGHT\.pkl: .*{says}"):
        read_mano(write(change(dict(contents["right"]))))


@pytest.mark.parametrize(
    "stored",
    [
        {},
        {"a": np.zeros(5), "idxs": np.array([9])},
        {"a": np.zeros(6), "idxs": np.arange(6), "preferred_shape": (4, 2)},
    ],
)
def test_a_node_of_chumpy_that_makes_no_array_is_named(maker, contents, tmp_path, stored):
    import sys

    modules = maker.chumpy_modules()
    content = contents["right"] | {"shapedirs": modules["chumpy.reordering"].Select(**stored)}
    with pytest.MonkeyPatch.context() as patch:
        for name, module in modules.items():
            patch.setitem(sys.modules, name, module)
        (tmp_path / "MANO_RIGHT.pkl").write_bytes(pickle.dumps(content))
    with pytest.raises(InputError, match="shapedirs does not hold an array"):
        read_mano(tmp_path / "MANO_RIGHT.pkl")


def test_the_hand_must_be_known_and_the_right_one(mano_folder, tmp_path):
    unnamed = tmp_path / "hand.pkl"
    unnamed.write_bytes((mano_folder / "MANO_RIGHT.pkl").read_bytes())
    with pytest.raises(SettingsError, match="no hand is named"):
        MANO.load(unnamed)
    assert MANO.load(unnamed, "right").hand == "right"
    with (
        pytest.raises(InputError, match="is it the other hand's"),
        pytest.warns(UserWarning, match="wrong sign"),
    ):
        MANO.load(unnamed, "left")
    with pytest.raises(SettingsError, match="expected left or right"):
        MANO.load(unnamed, "both")
    with pytest.raises(SettingsError, match="manopth, smplx, freihand, minimal-hand"):
        MANO.load(mano_folder, "right", tips="nails")
