/* What answers where no implementation is named; an implementation may hand its calls on to it. */
#ifndef catalyst_stub_h
#define catalyst_stub_h

#include "catalyst_api.h"

#ifdef __cplusplus
extern "C" {
#endif

CATALYST_EXPORT enum catalyst_status catalyst_stub_initialize(const conduit_node* params);
CATALYST_EXPORT enum catalyst_status catalyst_stub_execute(const conduit_node* params);
CATALYST_EXPORT enum catalyst_status catalyst_stub_finalize(const conduit_node* params);
CATALYST_EXPORT enum catalyst_status catalyst_stub_about(conduit_node* params);
CATALYST_EXPORT enum catalyst_status catalyst_stub_results(conduit_node* params);

#ifdef __cplusplus
}
#endif

#endif
