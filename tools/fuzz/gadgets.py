"""Pickles that would run something, in every form in which a pickle can ask for it."""

from __future__ import annotations

import struct
from collections.abc import Iterator

NAMES = (
    """
os system|os popen|os execv|os spawnl|os fork|os kill|os remove|os unlink|os rename|os mkdir
os open|os putenv|os startfile|os.path join|posix system|posix popen|posix execve|posix fork
nt system|subprocess Popen|subprocess call|subprocess run|subprocess check_output
subprocess getoutput|builtins eval|builtins exec|builtins compile|builtins open
builtins __import__|builtins getattr|builtins setattr|builtins delattr|builtins globals
builtins vars|builtins map|builtins filter|builtins apply|builtins type|builtins super
builtins input|builtins breakpoint|builtins print|builtins exit|builtins memoryview
builtins range|builtins zip|builtins sum|builtins sorted|builtins iter|builtins classmethod
__builtin__ eval|__builtin__ execfile|__builtin__ file|__builtin__ getattr|__builtin__ apply
__builtin__ reduce|__builtin__ reload|__builtin__ __import__|__builtin__ compile
__main__ __dict__|io open|io FileIO|_io open|_io FileIO|io BytesIO|codecs open|codecs decode
codecs encode|codecs lookup|_codecs decode|_codecs lookup|_codecs register
operator attrgetter|operator itemgetter|operator methodcaller|operator call|operator imul
operator concat|_operator attrgetter|_operator methodcaller|functools partial|functools reduce
functools lru_cache|functools wraps|_functools partial|itertools repeat|itertools chain
itertools starmap|itertools product|itertools count|importlib import_module
importlib reload|importlib __import__|importlib.util find_spec
importlib.machinery SourceFileLoader|runpy run_path|runpy run_module|runpy _run_code
pty spawn|pdb run|pdb Pdb|bdb Bdb|code interact|code InteractiveInterpreter
timeit timeit|timeit main|cProfile run|profile run|trace Trace|doctest debug_script
types CodeType|types FunctionType|types MethodType|types ModuleType|types SimpleNamespace
copyreg __newobj__|copyreg __newobj_ex__|copyreg add_extension|copyreg dispatch_table
copyreg _slotnames|copy_reg __newobj__|copy copy|copy deepcopy|pickle loads|pickle load
pickle Unpickler|_pickle loads|_pickle Unpickler|marshal loads|marshal load|shelve open
dbm open|sqlite3 connect|ctypes CDLL|ctypes cdll|ctypes string_at|ctypes memmove
ctypes cast|_ctypes dlopen|_ctypes call_function|cffi FFI|mmap mmap|socket socket
socket create_connection|_socket socket|ssl SSLContext|http.client HTTPConnection
urllib.request urlopen|urllib.request urlretrieve|ftplib FTP|smtplib SMTP|telnetlib Telnet
xmlrpc.client ServerProxy|webbrowser open|asyncio run|asyncio create_subprocess_shell
multiprocessing Process|multiprocessing Pool|multiprocessing.util spawnv_passfds
multiprocessing.reduction _rebuild_partial|multiprocessing.shared_memory SharedMemory
multiprocessing.managers RebuildProxy|concurrent.futures ProcessPoolExecutor
threading Thread|_thread start_new_thread|signal signal|signal alarm|atexit register
sys exit|sys settrace|sys setrecursionlimit|sys modules|sys path|gc get_objects
inspect getsource|linecache getlines|logging.config dictConfig|logging FileHandler
shutil rmtree|shutil copy|shutil move|tempfile mkstemp|tempfile NamedTemporaryFile
pathlib Path|pathlib PosixPath|glob glob|zipfile ZipFile|tarfile open|gzip open
bz2 open|lzma open|zipimport zipimporter|pkgutil get_data|pkgutil resolve_name|site main
ensurepip bootstrap|pip main|distutils.spawn spawn|venv create|random Random|time sleep
datetime datetime|decimal Decimal|fractions Fraction|uuid UUID|enum Enum|string Formatter
re compile|re._compiler compile|collections deque|collections defaultdict|collections Counter
collections namedtuple|collections UserDict|weakref ref|weakref finalize|contextlib ExitStack
array array|array _array_reconstructor|numpy load|numpy save|numpy fromfile|numpy memmap
numpy frompyfunc|numpy fromfunction|numpy vectorize|numpy apply_along_axis|numpy zeros|numpy void
numpy record|numpy recarray|numpy frombuffer|numpy.core.multiarray fromfile
numpy.core.multiarray empty|numpy.core.multiarray zeros|numpy.core.multiarray dtype
numpy.core.records recarray|numpy._core.multiarray fromfile|numpy._core._multiarray_umath zeros
numpy._core._multiarray_umath _reconstruct|numpy.core.memmap memmap|numpy.ma MaskedArray
numpy.ma.core _mareconstruct|numpy.random _pickle|numpy.random._pickle __randomstate_ctor
numpy.lib.npyio load|numpy.lib.npyio NpzFile|numpy.testing run_string|numpy.distutils exec_command
numpy.testing._private.utils runstring|numpy.f2py compile|numpy.ctypeslib load_library
numpy.lib._datasource open|scipy.io loadmat|scipy.sparse load_npz|scipy.sparse dok_matrix
scipy.optimize minimize|chumpy.ch ChLambda|chumpy.utils timer|chumpy load|theano function
pandas read_pickle|pandas eval|pandas io|joblib load|torch load|torch._utils _rebuild_tensor_v2
torch.storage _load_from_bytes|torch.hub load|tensorflow function|cloudpickle loads|dill loads
cloudpickle.cloudpickle _make_function|yaml load|yaml unsafe_load|jinja2 Template|requests get
django.db connection|flask Flask|handtrack load|handtrack.cli run|handtrack.hand.unpickle unpickle
numba jit|llvmlite.binding load_library_permanently|rerun init|idlelib.run Executive
antigravity geohash|lib2to3.pgen2.grammar Grammar|test.support run_in_subinterp
""".replace("\n", "|")
    .strip("|")
    .split("|")
)
ARGUMENTS = ("touch TRACE", "open('TRACE', 'w')", "TRACE")


def _text(value: str) -> bytes:
    data = value.encode()
    return b"X" + struct.pack("<I", len(data)) + data


def forms(module: str, name: str, argument: str) -> Iterator[bytes]:
    """One call with one text, in each form that opcodes have for it."""
    ask = f"c{module}\n{name}\n".encode()
    stack = b"\x80\x04" + _text(module) + _text(name) + b"\x93"
    yield ask + b"(S'" + argument.encode().replace(b"'", b"\\'") + b"'\ntR."
    yield b"\x80\x02" + ask + _text(argument) + b"\x85R."
    yield stack + _text(argument) + b"\x85R."
    yield b"(" + _text(argument) + f"i{module}\n{name}\n.".encode()
    yield b"(" + ask + _text(argument) + b"o."
    yield b"\x80\x02" + ask + _text(argument) + b"\x85\x81."
    yield stack + _text(argument) + b"\x85}\x92."
    yield ask + b")R}" + _text("x") + _text(argument) + b"sb."
    yield b"}" + _text("handJoints3D") + ask + _text(argument) + b"\x85Rs."


def odd() -> Iterator[tuple[str, bytes]]:
    """What is no call of a name, by what it is."""
    for code in (b"\x82\x01", b"\x83\x01\x00", b"\x84\x01\x00\x00\x00"):
        yield "extension", b"\x80\x02" + code + b")R."
    yield "persistent", b"Pname\n."
    yield "persistent", b"\x80\x02Nq\x00Q."
    yield "buffer", b"\x80\x05\x97."
    yield "buffer", b"\x80\x05\x97\x98."
    for target in (b"]", b"}", b")", b"N", b"K\x01", b"C\x01a", b"\x8f"):
        yield "state", b"\x80\x04" + target + b"}" + _text("x") + b"K\x01sb."
        yield "call", b"\x80\x04" + target + b")R."
    class_of = b"cnumpy\nndarray\n"
    yield "attributes", class_of + b"}" + _text("__init__") + b"Nsb."
    yield "attributes", b"\x80\x04" + _text("numpy") + _text("ndarray.__init__") + b"\x93."
    yield "blank", b"ccopy_reg\n_reconstructor\n(c__builtin__\nset\nc__builtin__\nobject\nNtR."
    yield "blank", b"ccopyreg\n_reconstructor\n(K\x01K\x02NtR."
    for encoding in ("bz2", "zlib", "idna", "punycode", "unicode_escape", "rot13", "x" * 10**5):
        yield "encoding", b"c_codecs\nencode\n(" + _text("x") + _text(encoding) + b"tR."


def pointers() -> Iterator[bytes]:
    """Types of NumPy with an object in them, for which bytes of the file would be a pointer."""
    eight = b"AAAAAAAA"
    kind = b"cnumpy\ndtype\n"
    for core in (b"numpy.core", b"numpy._core"):
        scalar = b"c" + core + b".multiarray\nscalar\n"
        fields = (
            b"}" + _text("f") + kind + b"(" + _text("O8") + b"K\x00K\x01tR"
            b"(K\x03" + _text("|") + b"NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x3ftbK\x00\x86s"
        )
        void = (
            kind + b"(" + _text("V8") + b"K\x00K\x01tR(K\x03" + _text("|") + b"N"
            b"(" + _text("f") + b"t" + fields + b"K\x08K\x01K\x1btb"
        )
        for name in (b"O8", b"V8", b"O", b"|O", b"V"):
            plain = kind + b"(" + _text(name.decode()) + b"K\x00K\x01tR"
            yield b"\x80\x03" + scalar + plain + b"C\x08" + eight + b"\x86R."
        yield b"\x80\x03" + scalar + void + b"C\x08" + eight + b"\x86R."
        f8 = kind + b"(" + _text("f8") + b"K\x00K\x01tR"
        changed = (
            f8 + b"(K\x03" + _text("|") + b"N(" + _text("f") + b"t" + fields + b"K\x08K\x01K\x1btb"
        )
        yield b"\x80\x03" + scalar + changed + b"C\x08" + eight + b"\x86R."
        array = b"c" + core + b".multiarray\n_reconstruct\n(cnumpy\nndarray\nK\x00\x85C\x01btR"
        for of in (void, kind + b"(" + _text("O8") + b"K\x00K\x01tR"):
            yield b"\x80\x03" + array + b"(K\x01K\x01\x85" + of + b"\x89C\x08" + eight + b"tb."
        buffer = b"c" + core + b".numeric\n_frombuffer\n(C\x08" + eight
        yield b"\x80\x05" + buffer + void + b"K\x01\x85" + _text("C") + b"tR."


def bombs() -> Iterator[tuple[str, bytes]]:
    """Few bytes that would take much memory, much time, or the process down."""
    many = 10**6
    yield "tuples", b"N" + b"\x85" * many + b"."
    yield "tuples as keys", b"}" + b"N" + b"\x85" * many + b"Ns."
    yield "tuples in a set", b"\x80\x04\x8f(N" + b"\x85" * many + b"\x90."
    yield "tuples in a frozen set", b"\x80\x04(N" + b"\x85" * many + b"\x91."
    yield "lists", b"]" * many + b"a" * (many - 1) + b"."
    yield "lists from outside", b"]q\x01" + b"]q\x00ah\x00" * (many // 4) + b"h\x01."
    yield "dictionaries", b"}" + b"N}" * (many // 2) + b"s" * (many // 2) + b"."
    yield "marks", b"(" * many + b"."
    yield "tuples of marks", b"(" * many + b"t" * many + b"."
    yield (
        "stand-ins",
        b"cchumpy.ch\nCh\n)R" * 10**5 + (b"}X\x01\x00\x00\x00x" + b"Nsb0") * 10 + b".",
    )
    node = b"cchumpy.ch\nCh\nq\x01)R"
    nest = b"h\x01)R}X\x01\x00\x00\x00x"
    yield "nodes in nodes", node + b"0" + nest * 10**5 + b"N" + b"sb" * 10**5 + b"."
    for code, form in (
        (b"\x96", "<Q"),
        (b"\x8e", "<Q"),
        (b"\x8d", "<Q"),
        (b"B", "<I"),
        (b"X", "<I"),
    ):
        for size in (6 * 2**30, 2**31 - 1, 2**40, 2**63, 2**64 - 1):
            if size < 2 ** (8 * struct.calcsize(form)):
                yield "a length", b"\x80\x05" + code + struct.pack(form, size) + b"x."
    for size in (2**31 - 1, -1, -(2**31)):
        yield "a length", b"\x80\x02\x8b" + struct.pack("<i", size) + b"x."
        yield "a length", b"\x80\x02T" + struct.pack("<i", size) + b"x."
    yield "a frame", b"\x80\x04\x95" + struct.pack("<Q", 2**63) + b"]."
    yield "the memo", b"Nr\xff\xff\xff\x7f."
    yield "the memo", b"Np" + b"9" * 5000 + b"\n."
    yield "digits", b"I" + b"9" * 5000 + b"\n."
    yield "digits", b"L" + b"9" * 10**6 + b"L\n."
    yield "digits", b"F" + b"9" * 10**6 + b"\n."
    yield "digits", b"\x80\x02\x8b" + struct.pack("<i", 10**6) + b"\x7f" * 10**6 + b"."
    for container in (b"]", b")"):
        for depth in (40, 99, 10**4):
            double = b"2\x86" if container == b")" else b"q\x00]h\x00ah\x00a"
            yield "doubling", container + double * depth + b"."
            joints = b"}" + _text("handJoints3D") + container + double * depth + b"s."
            yield "doubling", b"\x80\x02" + joints
    yield "itself", b"]q\x00h\x00a."
    yield "itself", b"\x80\x02}" + _text("handJoints3D") + b"]q\x00h\x00as."
    yield "itself", b"cchumpy.ch\nCh\n)Rq\x00}" + _text("x") + b"h\x00sb."
    text = b"\x80\x02" + _text("x" * 10**6) + b"q\x000"
    encode = b"c_codecs\nencode\nq\x01" + b"0" + b"h\x01h\x00\x85R" * 10**5
    yield "the same bytes", text + encode + b"."
    keys = b"".join(
        b"\x8a\x10" + (i * (2**61 - 1)).to_bytes(16, "little") + b"N" for i in range(1, 10**5)
    )
    yield "keys that share a place", b"\x80\x02}(" + keys + b"u."
    yield "surrogates", b"\x80\x02X\x03\x00\x00\x00\xed\xa0\x80."
    yield "surrogates", b"V\\ud800\n."
    kind = b"cnumpy\ndtype\n(" + _text("f8") + b"K\x00K\x01tR"
    array = b"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\nK\x00\x85C\x01btR"
    for shape in (
        b"J\xff\xff\xff\x7f" * 3 + b"\x87",
        b"J\xff\xff\xff\xff\x85",
        b"(" + b"K\x01" * 65 + b"t",
    ):
        yield "a shape", b"\x80\x03" + array + b"(K\x01" + shape + kind + b"\x89C\x00tb."
    yield (
        "a shape of nothing",
        b"\x80\x03" + array + b"(K\x01K\x00J\xff\xff\xff\x7f\x86" + kind + b"\x89C\x00tb.",
    )
    for other in (
        b"",
        b".",
        b"\x80\x05.",
        b"\x80\xff.",
        b"t.",
        b"R.",
        b"b.",
        b"s.",
        b"\x93.",
        b"a.",
    ):
        yield "too little", other
