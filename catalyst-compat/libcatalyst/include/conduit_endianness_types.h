/* The order of the bytes of a number. */
#ifndef conduit_endianness_types_h
#define conduit_endianness_types_h

typedef enum
{
  CONDUIT_ENDIANNESS_DEFAULT_ID = 0,
  CONDUIT_ENDIANNESS_BIG_ID = 1,
  CONDUIT_ENDIANNESS_LITTLE_ID = 2
} conduit_endianness_type_id;

#define CONDUIT_ENDIANNESS_DEFAULT_T CONDUIT_ENDIANNESS_DEFAULT_ID
#define CONDUIT_ENDIANNESS_BIG_T CONDUIT_ENDIANNESS_BIG_ID
#define CONDUIT_ENDIANNESS_LITTLE_T CONDUIT_ENDIANNESS_LITTLE_ID

#endif
