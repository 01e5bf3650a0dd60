/* Wall time of the stages, for the caller's information only: no decision depends on it. */
#ifndef FATHOM_TIMING_H
#define FATHOM_TIMING_H

/* Milliseconds of the monotonic clock. */
double timing_ms(void);

#endif
