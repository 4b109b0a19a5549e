/* What an implementation of Catalyst exports: the variable catalyst_api_impl. */
#ifndef catalyst_impl_h
#define catalyst_impl_h

#include "catalyst_api.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The functions of an implementation; version is 1. */
struct catalyst_impl
{
  int version;
  enum catalyst_status (*initialize)(const conduit_node*);
  enum catalyst_status (*execute)(const conduit_node*);
  enum catalyst_status (*finalize)(const conduit_node*);
  enum catalyst_status (*about)(conduit_node*);
  enum catalyst_status (*results)(conduit_node*);
};

#ifdef __cplusplus
}
#endif

#endif
