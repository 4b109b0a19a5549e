/* Meshes. */
#ifndef conduit_blueprint_mesh_h
#define conduit_blueprint_mesh_h

#include "conduit.h"
#include "conduit_blueprint_c_exports.h"

#ifdef __cplusplus
extern "C" {
#endif

CONDUIT_BLUEPRINT_C_API int conduit_blueprint_mesh_verify(const conduit_node* node, conduit_node* info);
/* Sub protocols: coordset, topology, field, matset, specset, adjset, nestset, index, and parts of them such as topology/shape. */
CONDUIT_BLUEPRINT_C_API int conduit_blueprint_mesh_verify_sub_protocol(
  const char* protocol, const conduit_node* node, conduit_node* info);
/* Says what is in a mesh, without its arrays, for readers of files. */
CONDUIT_BLUEPRINT_C_API void conduit_blueprint_mesh_generate_index(
  const conduit_node* mesh, const char* path, conduit_index_t number_of_domains, conduit_node* index);
/* Cuts a mesh into domains, or joins them. */
CONDUIT_BLUEPRINT_C_API void conduit_blueprint_mesh_partition(
  const conduit_node* mesh, const conduit_node* options, conduit_node* output);
/* Makes tables of a mesh's vertices and elements. */
CONDUIT_BLUEPRINT_C_API void conduit_blueprint_mesh_flatten(
  const conduit_node* mesh, const conduit_node* options, conduit_node* output);

#ifdef __cplusplus
}
#endif

#endif
