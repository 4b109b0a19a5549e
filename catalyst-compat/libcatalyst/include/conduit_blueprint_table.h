/* Tables: columns of one length below `values`. */
#ifndef conduit_blueprint_table_h
#define conduit_blueprint_table_h

#include "conduit.h"
#include "conduit_blueprint_c_exports.h"

#ifdef __cplusplus
extern "C" {
#endif

CONDUIT_BLUEPRINT_C_API int conduit_blueprint_table_verify(const conduit_node* node, conduit_node* info);
CONDUIT_BLUEPRINT_C_API int conduit_blueprint_table_verify_sub_protocol(
  const char* protocol, const conduit_node* node, conduit_node* info);

#ifdef __cplusplus
}
#endif

#endif
