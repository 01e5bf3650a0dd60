/* Detects leaps between the IMU's clock and the depth camera's during a scan, by the order in which samples and frames
 * arrive. It can't in a recording sorted by stamps. */
#ifndef FATHOM_CLOCK_WATCH_H
#define FATHOM_CLOCK_WATCH_H

#include <stdbool.h>
#include <stdint.h>

/* All stamps in nanoseconds; all zero: nothing known yet. */
typedef struct {
    bool known;
    double least;                /* minimum lead so far; grows when frames wait in a queue */
    double lead;                 /* usual value of newest sample - frame when the frame is taken */
    int64_t frame_ns, sample_ns; /* at the last frame that came with new samples */
    int64_t before_ns, after_ns; /* neighbouring samples with a leap between their stamps since then; equal: none */
    bool doubt;                  /* a leap of one clock only, not confirmed yet */
    double leap;                 /* its size if no sample was lost; 0: it was the depth clock's */
    double lead_sum;             /* over the frames since */
    int leads;
    int64_t since_frame_ns, since_sample_ns; /* the first frame and the first sample after the leap */
} clock_watch;

/* Takes two consecutive samples. */
void clock_watch_samples(clock_watch *w, int64_t before_ns, int64_t after_ns);

/* Takes a frame, after all samples that arrived before it; newest_ns: the last of them, after the last frame's. Returns
 * the correction of the stamps of samples from *from_ns on, including all future ones; mostly 0. */
int64_t clock_watch_frame(clock_watch *w, int64_t frame_ns, int64_t newest_ns, int64_t period_ns,
                          int64_t *from_ns);

#endif
