/* A check that ends the program where it does not hold. */
#ifndef check_h
#define check_h

#include <stdio.h>
#include <stdlib.h>

#define CHECK(condition)                                                                                     \
  do                                                                                                         \
  {                                                                                                          \
    if (!(condition))                                                                                        \
    {                                                                                                        \
      fprintf(stderr, "%s, line %d: %s\n", __FILE__, __LINE__, #condition);                                  \
      exit(1);                                                                                               \
    }                                                                                                        \
  } while (0)

#endif
