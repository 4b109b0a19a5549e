"""libcatalyst as ctypes sees it: its functions, and its errors as exceptions."""

import ctypes
import os
import threading

_NAME = "libcatalyst.so.3"


class Error(RuntimeError):
    """What libcatalyst says went wrong."""


def _load():
    # <prefix>/lib/pythonX.Y/site-packages/catalyst_conduit is below the library's directory.
    directory = os.path.dirname(os.path.abspath(__file__))
    beside = os.path.realpath(os.path.join(directory, "..", "..", "..", _NAME))
    return ctypes.CDLL(beside if os.path.exists(beside) else _NAME, mode=ctypes.RTLD_GLOBAL)


_library = _load()
_thread = threading.local()
_HANDLER = ctypes.CFUNCTYPE(None, ctypes.c_char_p, ctypes.c_char_p, ctypes.c_int)


@_HANDLER
def _note(message, _file, _line):
    # The first error of a call is the one to tell; those after it follow from it.
    if getattr(_thread, "message", None) is None:
        _thread.message = message.decode(errors="replace")


_library.catalyst_conduit_utils_set_error_handler(_note)
_library.catalyst_conduit_utils_set_warning_handler(_note)

_POINTER, _TEXT, _INDEX, _INT = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int64, ctypes.c_int
_RESULTS = {
    _POINTER: """create append child parent fetch fetch_existing child_by_name dtype element_ptr as_char8_str name path
        to_json to_yaml to_string to_summary_string""".split(),
    _INDEX: """number_of_children number_of_elements total_strided_bytes total_bytes_compact
        total_bytes_allocated""".split(),
}
for _type, _names in _RESULTS.items():
    for _name in _names:
        _library["catalyst_conduit_node_" + _name].restype = _type
for _name in ("id", "number_of_elements", "stride", "element_bytes", "endianness"):
    _library["catalyst_conduit_datatype_" + _name].restype = _INDEX

_libc = ctypes.CDLL(None)
_libc.free.argtypes = [_POINTER]


def _argument(value):
    if isinstance(value, str):
        return _TEXT(value.encode())
    if isinstance(value, bytes):
        return _TEXT(value)
    if isinstance(value, float):
        return ctypes.c_double(value)
    return value if isinstance(value, (_POINTER, ctypes.c_double)) else _INDEX(int(value))


def called(name, *arguments):
    """Calls a function of the library by its name; what it says went wrong is raised."""
    _thread.message = None
    answer = _library[name](*map(_argument, arguments))
    message, _thread.message = _thread.message, None
    if message is not None:
        raise Error(message)
    return answer


def text_of(address):
    """The text at an address that the library keeps."""
    return ctypes.string_at(address).decode(errors="replace") if address else ""


def taken(address):
    """The text at an address that the library hands over."""
    text = text_of(address)
    _libc.free(address)
    return text
