"""The protocol `mesh` of Blueprint."""

from .._library import called


def verify(node, info, protocol=None):
    """Whether a tree keeps to the protocol, or to a part of it such as "topology"; what is wrong is in `info`."""
    name = "catalyst_conduit_blueprint_mesh_verify"
    if protocol is None:
        return bool(called(name, node.handle, info.handle))
    return bool(called(name + "_sub_protocol", protocol, node.handle, info.handle))


def generate_index(mesh, reference_path, number_of_domains, index):
    """Fills `index` with what is in a mesh, without its arrays."""
    called(
        "catalyst_conduit_blueprint_mesh_generate_index", mesh.handle, reference_path, number_of_domains, index.handle
    )


def partition(mesh, options, output):
    """Cuts or joins the domains of a mesh."""
    called("catalyst_conduit_blueprint_mesh_partition", mesh.handle, options.handle, output.handle)


def flatten(mesh, options, output):
    """Makes tables of a mesh."""
    called("catalyst_conduit_blueprint_mesh_flatten", mesh.handle, options.handle, output.handle)
