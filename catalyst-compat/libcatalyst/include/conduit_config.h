/* How this Conduit is configured. */
#ifndef conduit_config_h
#define conduit_config_h

#define CONDUIT_VERSION "0.9.2"
#define CONDUIT_VERSION_MAJOR 0
#define CONDUIT_VERSION_MINOR 9
#define CONDUIT_VERSION_PATCH 2
#define CONDUIT_INDEX_64
#define CONDUIT_USE_CXX11

#if defined(__APPLE__)
#define CONDUIT_PLATFORM_APPLE
#else
#define CONDUIT_PLATFORM_UNIX
#endif

#endif
