/* What a shared library shows and what it hides. */
#ifndef catalyst_export_h
#define catalyst_export_h

#if defined(__GNUC__)
#define CATALYST_EXPORT __attribute__((visibility("default")))
#define CATALYST_NO_EXPORT __attribute__((visibility("hidden")))
#else
#define CATALYST_EXPORT
#define CATALYST_NO_EXPORT
#endif

#endif
