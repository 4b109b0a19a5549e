/* The version of Catalyst whose interface these headers declare. */
#ifndef catalyst_version_h
#define catalyst_version_h

#define CATALYST_VERSION "2.0.0"
#define CATALYST_VERSION_MAJOR 2
#define CATALYST_VERSION_MINOR 0
#define CATALYST_VERSION_PATCH 0
#define CATALYST_ABI_VERSION "3"

#endif
