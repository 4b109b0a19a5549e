/* How this Blueprint is configured: without the parts that need MPI and ParMETIS. */
#ifndef conduit_blueprint_config_h
#define conduit_blueprint_config_h

#endif
