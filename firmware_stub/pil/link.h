#ifndef PIL_LINK_H
#define PIL_LINK_H

/* A stream of bytes to the host; the build chooses how it is made. */

#include <stdbool.h>
#include <stddef.h>

/** False if there is no host. */
bool link_open(void);

/** Waits for exactly so many bytes; false at the end of the link. */
bool link_read(void *data, size_t size);

/** False at the end of the link. */
bool link_write(const void *data, size_t size);

/** Ends the program, as far as the link can. */
void link_close(bool good);

#endif
