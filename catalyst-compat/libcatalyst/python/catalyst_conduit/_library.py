"""libcatalyst as ctypes sees it: its functions with their types, and its errors as exceptions."""

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


TYPES = "int8 int16 int32 int64 uint8 uint16 uint32 uint64 float32 float64".split()

_HANDLER = ctypes.CFUNCTYPE(None, ctypes.c_char_p, ctypes.c_char_p, ctypes.c_int)
# What stands for a type in the signatures below. A text that is handed over is an address: it is to be freed.
_LETTERS = {
    "v": None,
    "p": ctypes.c_void_p,
    "s": ctypes.c_char_p,
    "n": ctypes.c_int64,
    "i": ctypes.c_int,
    "d": ctypes.c_double,
    "h": _HANDLER,
}
_LAYOUT = "nnnnn"

# The result, then the arguments.
_SIGNATURES = {
    "catalyst_conduit_node_": {
        "pp": "dtype parent append name path to_json to_yaml to_string to_summary_string as_char8_str",
        "ppp": "to_json_with_options to_yaml_with_options to_string_with_options to_summary_string_with_options",
        "pps": "fetch fetch_existing add_child child_by_name",
        "ppn": "child element_ptr",
        "p": "create",
        "np": "number_of_children number_of_elements total_strided_bytes total_bytes_compact total_bytes_allocated",
        "ip": "is_root is_data_external is_compact is_contiguous",
        "ips": "has_child has_path",
        "ipp": "compatible contiguous_with_node contiguous_with_address",
        "ipppd": "diff diff_compatible",
        "vp": "destroy reset print print_detailed",
        "vpp": "move swap info compact_to update update_compatible update_external set_node set_external_node",
        "vps": "set_char8_str remove_path remove_child_by_name",
        "vpn": "remove_child",
        "vpss": "rename_child parse load save",
        "vpssp": "generate generate_external",
        "vpp" + _LAYOUT: " ".join(
            f"{how}_{name}_ptr_detailed" for how in ("set", "set_external") for name in TYPES
        ),
    },
    "catalyst_conduit_datatype_": {
        "np": "id number_of_elements offset stride element_bytes endianness",
    },
    "catalyst_conduit_blueprint_": {
        "ipp": "mcarray_verify mesh_verify table_verify",
        "ispp": "verify mcarray_verify_sub_protocol mesh_verify_sub_protocol table_verify_sub_protocol",
        "vpsnp": "mesh_generate_index",
        "vppp": "mesh_partition mesh_flatten",
    },
    "catalyst_conduit_": {"vp": "about"},
    "catalyst_conduit_utils_": {"vh": "set_info_handler set_warning_handler set_error_handler"},
    "catalyst_": {"ip": "initialize execute finalize about results"},
}


def _typed(library):
    """The functions of the library. Each is looked up once and kept: ctypes makes another object of it at each look-up by index,
    without the types, and cuts addresses to the width of an int."""
    functions = {}
    for prefix, by_signature in _SIGNATURES.items():
        for signature, names in by_signature.items():
            result, *arguments = (_LETTERS[letter] for letter in signature)
            for name in names.split():
                function = getattr(library, prefix + name)
                function.restype = result
                function.argtypes = arguments
                functions[prefix + name] = function
    return functions


FUNCTIONS = _typed(_load())
_thread = threading.local()


@_HANDLER
def _note(message, _file, _line):
    # The first error of a call is the one to tell; those after it follow from it.
    if getattr(_thread, "message", None) is None:
        _thread.message = message.decode(errors="replace")


FUNCTIONS["catalyst_conduit_utils_set_error_handler"](_note)
FUNCTIONS["catalyst_conduit_utils_set_warning_handler"](_note)

_free = ctypes.CDLL(None).free
_free.restype = None
_free.argtypes = [ctypes.c_void_p]


def called(name, *arguments):
    """Calls a function of the library by its name; what it says went wrong is raised."""
    _thread.message = None
    answer = FUNCTIONS[name](*(value.encode() if isinstance(value, str) else value for value in arguments))
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
    _free(address)
    return text
