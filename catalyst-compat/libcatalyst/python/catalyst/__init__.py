"""Catalyst from Python: what a solver calls, over the functions of libcatalyst.

Each function takes a `catalyst_conduit.Node` and raises `CatalystError` where Catalyst answers with another status than 0.
"""

from catalyst_conduit import Node
from catalyst_conduit._library import called

__all__ = ["CatalystError", "about", "execute", "finalize", "initialize", "results"]

_STATUS = {
    1: "no implementation is loaded",
    2: "an implementation is already loaded",
    3: "the implementation was not found",
    4: "the library is no implementation of Catalyst",
    5: "the implementation lacks a function",
    6: "the implementation is of another version of Catalyst",
    7: "the implementation has another Conduit",
}


class CatalystError(RuntimeError):
    """What Catalyst answered, with its number as `status`."""

    def __init__(self, function, status):
        self.status = status
        super().__init__(f"catalyst_{function}: {_STATUS.get(status, 'the implementation failed')} (status {status})")


def _call(function, node):
    if not isinstance(node, Node):
        raise TypeError(f"catalyst.{function} takes a catalyst_conduit.Node, not {type(node).__name__}")
    status = called("catalyst_" + function, node.handle)
    if status != 0:
        raise CatalystError(function, status)


def initialize(node):
    """Loads the implementation that `catalyst_load` names, and hands it the node."""
    _call("initialize", node)


def execute(node):
    """Hands over a step. Arrays that were set external are read, not copied."""
    _call("execute", node)


def finalize(node):
    """Ends what `initialize` began."""
    _call("finalize", node)


def about(node):
    """Fills the node with what the implementation says of itself."""
    _call("about", node)


def results(node):
    """Fills the node with what the implementation has for the solver."""
    _call("results", node)
