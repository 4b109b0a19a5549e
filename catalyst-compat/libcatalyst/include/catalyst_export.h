/* What a shared library shows, what it hides, and what is out of date. */
#ifndef catalyst_export_h
#define catalyst_export_h

#if defined(__GNUC__)
#define CATALYST_EXPORT __attribute__((visibility("default")))
#define CATALYST_NO_EXPORT __attribute__((visibility("hidden")))
#else
#define CATALYST_EXPORT
#define CATALYST_NO_EXPORT
#endif

/* A project may define its own, for a compiler that knows another word. */
#ifndef CATALYST_DEPRECATED
#if defined(__GNUC__)
#define CATALYST_DEPRECATED __attribute__((__deprecated__))
#else
#define CATALYST_DEPRECATED
#endif
#endif
#ifndef CATALYST_DEPRECATED_EXPORT
#define CATALYST_DEPRECATED_EXPORT CATALYST_EXPORT CATALYST_DEPRECATED
#endif
#ifndef CATALYST_DEPRECATED_NO_EXPORT
#define CATALYST_DEPRECATED_NO_EXPORT CATALYST_NO_EXPORT CATALYST_DEPRECATED
#endif

#endif
