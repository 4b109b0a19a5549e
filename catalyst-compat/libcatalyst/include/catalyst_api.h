/* The five calls of Catalyst. Each takes a node and answers with a status; see catalyst_status. */
#ifndef catalyst_api_h
#define catalyst_api_h

#include "catalyst_export.h"
#include "catalyst_version.h"
#include "conduit.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What a call answers. An implementation may answer with numbers of its own, from 100 on. */
enum catalyst_status
{
  catalyst_status_ok = 0,
  catalyst_status_error_no_implementation = 1,
  catalyst_status_error_already_loaded = 2,
  catalyst_status_error_not_found = 3,
  catalyst_status_error_not_catalyst = 4,
  catalyst_status_error_incomplete = 5,
  catalyst_status_error_unsupported_version = 6,
  catalyst_status_error_conduit_mismatch = 7
};

/* Loads the implementation that is asked for and begins a session. */
CATALYST_EXPORT enum catalyst_status catalyst_initialize(const conduit_node* params);
/* Hands over one step. */
CATALYST_EXPORT enum catalyst_status catalyst_execute(const conduit_node* params);
/* Ends the session; the implementation stays loaded. */
CATALYST_EXPORT enum catalyst_status catalyst_finalize(const conduit_node* params);
/* Fills a node with who answers. */
CATALYST_EXPORT enum catalyst_status catalyst_about(conduit_node* params);
/* Fills a node with what the implementation has for the simulation. */
CATALYST_EXPORT enum catalyst_status catalyst_results(conduit_node* params);

#ifdef __cplusplus
}
#endif

#endif
