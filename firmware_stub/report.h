#ifndef REPORT_H
#define REPORT_H

/* Telemetry as text on the console, without a libc. */

#include "telemetry.h"

/** Writes what the columns of report_record are. */
void report_header(void);

/** Writes a record as one line of decimal numbers, separated by blanks; torque in m N m. */
void report_record(const telemetry_record *record);

/** Writes a word and a number as a line. */
void report_number(const char *word, uint32_t number);

#endif
