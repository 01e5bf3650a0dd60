/* Notices when the IMU's clock and the depth camera's part in the middle of a scan, by the order in which samples and
 * frames arrive. A recording that was put in the order of its stamps can't tell. */
#ifndef FATHOM_CLOCK_WATCH_H
#define FATHOM_CLOCK_WATCH_H

#include <stdbool.h>
#include <stdint.h>

/* All stamps in nanoseconds; all zero: nothing known yet. */
typedef struct {
    bool known;
    double least;                /* the least lead so far: with frames that wait in a queue, it grows */
    double lead;                 /* newest sample - frame, as it usually is when the frame is taken */
    int64_t frame_ns, sample_ns; /* at the last frame that came with new samples */
    int64_t before_ns, after_ns; /* neighbouring samples whose stamps leapt since then; equal: none did */
    bool doubt;                  /* a leap that the other clock hasn't made, not confirmed yet */
    double leap;                 /* what no sample lost would make of it; 0: it was the depth clock's */
    double lead_sum;             /* over the frames since */
    int leads;
    int64_t since_frame_ns, since_sample_ns; /* the first frame and the first sample after the leap */
} clock_watch;

/* Two samples in a row. */
void clock_watch_samples(clock_watch *w, int64_t before_ns, int64_t after_ns);

/* A frame, when all samples that arrived before it have been taken; newest_ns: the last of them, after the last
 * frame's. Returns what has to be added to the stamps of samples from *from_ns on, and of all to come; mostly 0. */
int64_t clock_watch_frame(clock_watch *w, int64_t frame_ns, int64_t newest_ns, int64_t period_ns,
                          int64_t *from_ns);

#endif
