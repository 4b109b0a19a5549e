/* The version of Catalyst whose interface these headers declare. */
#ifndef catalyst_version_h
#define catalyst_version_h

#define CATALYST_VERSION "2.0.0"
#define CATALYST_VERSION_MAJOR 2
#define CATALYST_VERSION_MINOR 0
#define CATALYST_VERSION_PATCH 0
#define CATALYST_ABI_VERSION "3"

/* A version as one number, for comparisons: #if CATALYST_VERSION_NUMBER >= CATALYST_VERSION_CHECK(2, 0, 0) */
#define CATALYST_VERSION_CHECK(major, minor, patch) (10000000000ULL * (major) + 100000000ULL * (minor) + (patch))
#define CATALYST_VERSION_NUMBER                                                                              \
  CATALYST_VERSION_CHECK(CATALYST_VERSION_MAJOR, CATALYST_VERSION_MINOR, CATALYST_VERSION_PATCH)

#endif
