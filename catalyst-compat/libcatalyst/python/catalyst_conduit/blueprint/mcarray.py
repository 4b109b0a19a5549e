"""The protocol `mcarray` of Blueprint."""

from .._library import called


def verify(node, info, protocol=None):
    """Whether a tree keeps to the protocol, or to a part of it such as "topology"; what is wrong is in `info`."""
    name = "catalyst_conduit_blueprint_mcarray_verify"
    if protocol is None:
        return bool(called(name, node.handle, info.handle))
    return bool(called(name + "_sub_protocol", protocol, node.handle, info.handle))
