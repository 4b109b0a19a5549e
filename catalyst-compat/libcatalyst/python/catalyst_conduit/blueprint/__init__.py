"""Blueprint: whether a tree is a mesh, a multi-component array or a table."""

from .._library import called
from . import mcarray, mesh, table

__all__ = ["mcarray", "mesh", "table", "verify"]


def verify(protocol, node, info):
    """Whether a tree keeps to a protocol; what is wrong is in `info`."""
    return bool(called("catalyst_conduit_blueprint_verify", protocol, node.handle, info.handle))
